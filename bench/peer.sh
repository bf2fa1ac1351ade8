#!/bin/sh
# Installs Mitsuba 3 into a private environment and measures it beside Reynolds, in turn, on the same scenes.
# usage: peer.sh REYNOLDS
set -e
here=$(dirname "$0")
venv=build/peer-venv
sh "$here/../scripts/setup.sh" python3-venv libllvm19 2>/dev/null || sh "$here/../scripts/setup.sh" python3-venv libllvm16
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install -q mitsuba numpy
fi
for library in /usr/lib/*/libLLVM.so.19.1 /usr/lib/*/libLLVM-16.so.1; do
    if [ -e "$library" ]; then
        DRJIT_LIBLLVM_PATH=$library
        export DRJIT_LIBLLVM_PATH
        break
    fi
done
exec "$venv/bin/python" "$here/peer.py" "$1"
