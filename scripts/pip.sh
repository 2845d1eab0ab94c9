#!/bin/sh
# Runs pip quietly with the pinned versions; when it fails, the last line says why in one sentence.
# usage: pip.sh <environment> <what for> <pip's arguments>
set -eu
environment=$1 purpose=$2
shift 2
log=$environment/pip.log

echo "$purpose"
export PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1
if "$environment/bin/python" -m pip "$@" >"$log" 2>&1; then
    exit 0
fi
if [ -n "${CI:-}" ]; then # where nobody can look into the file afterwards
    tail -n 60 "$log" >&2
    echo >&2
fi
# With pinned versions, a package that the index does not give out is reported as a conflict, too.
if grep -qE 'No matching distribution|ResolutionImpossible|ConnectionPool|ConnectionError|HTTP error|IncompleteRead|ReadTimeout|SSLError|DO NOT MATCH THE HASHES' "$log"; then
    machine=$(uname -sm)
    if [ "$machine" != "Linux x86_64" ]; then
        echo "bt_actions: there are ROS 2 wheels for Linux on x86_64 only, and this is $machine: build it in a ROS 2 workspace instead (docs/workspace.md, $log)." >&2
        exit 1
    fi
    echo "bt_actions: a download failed: check the network and pip's package index, then try again ($log)." >&2
else
    echo "bt_actions: pip failed; what it said is in $log." >&2
fi
exit 1
