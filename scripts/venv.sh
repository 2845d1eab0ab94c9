#!/bin/sh
# Makes a virtual environment with Python 3.11 or 3.12, or says in one sentence why it cannot.
# usage: venv.sh <folder> [<python>]     without <python>: the first of the usual names that will do
set -eu
folder=$1 asked=${2:-} found=

fail() {
    echo "bt_actions: $*" >&2
    exit 1
}

# What a command answers as its Python version, for example "3.12"; nothing if it does not run at all.
version() {
    "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true
}

# The interfaces are compiled, so Python needs its C headers as well as the venv module.
complete() {
    "$1" - 2>/dev/null <<'PYTHON'
import ensurepip, os, sys, sysconfig, venv
sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))
PYTHON
}

if [ -n "$asked" ]; then
    found=$(version "$asked")
    case $found in
    3.11 | 3.12) ;;
    *) fail "Python 3.11 or 3.12 is needed, and PYTHON=$asked ${found:+is Python }${found:-does not run}." ;;
    esac
fi

if [ -e "$folder" ]; then
    has=$(version "$folder/bin/python")
    [ -n "$has" ] && "$folder/bin/python" -c 'import pip' 2>/dev/null || fail "$folder does not run any more: \`make clean\`, then try again."
    [ "${found:-$has}" = "$has" ] ||
        fail "$folder was made with Python $has, and PYTHON=$asked is $found: \`make clean\` first."
    exit 0
fi

incomplete=
for python in ${asked:-python3.12 python3.11 python3}; do
    case $(version "$python") in
    3.11 | 3.12) ;;
    *) continue ;;
    esac
    if complete "$python"; then
        echo "Making $folder with $python"
        "$python" -m venv "$folder" || {
            rm -rf "$folder"
            fail "$python could not make a virtual environment in $folder (its own words are above)."
        }
        exit 0
    fi
    incomplete=$python
done

if [ -n "$incomplete" ]; then
    found=$(version "$incomplete")
    fail "$incomplete lacks its venv module or C headers: install them (Debian: python$found-venv python$found-dev)."
fi
fail "Python 3.11 or 3.12 is needed, and none was found: install one, or name it with PYTHON=..."
