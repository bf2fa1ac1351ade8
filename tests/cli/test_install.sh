#!/bin/sh
# An installation under any prefix tells pkg-config that prefix. Use: test_install.sh BUILD-FOLDER
set -e
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cmake --install "$1" --prefix "$folder/there" > /dev/null
found=$(find "$folder/there" -name reynolds.pc)
flags=$(pkg-config --cflags "$found")
include=${flags#-I}
include=${include% }
test -f "$include/reynolds/reynolds.h" || { echo "pkg-config says '$flags'"; exit 1; }
