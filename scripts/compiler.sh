#!/bin/sh
# Says in one sentence what is missing to compile C and C++; silent when all is there.
set -eu

# usage: check <name> <gcc's name of the language> <compilers to try>
check() {
    for compiler in $3; do
        if echo '#include <stdlib.h>' | "$compiler" -x "$2" -fsyntax-only - 2>/dev/null; then
            return
        fi
    done
    echo "bt_actions: no working $1 compiler was found (tried $3): install one (Debian: build-essential)." >&2
    exit 1
}

check C c "${CC:-cc gcc clang}"
check C++ c++ "${CXX:-c++ g++ clang++}"
