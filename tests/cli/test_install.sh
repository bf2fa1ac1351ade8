#!/bin/sh
# An installation under any prefix is all that a program needs: the C example is compiled, linked with the shared and the
# static library, by pkg-config and by CMake, and run, without a look at the sources.
# Use: test_install.sh BUILD-FOLDER SOURCE-FOLDER C-COMPILER [FLAG...]
set -e
build=$1 source=$2 compiler=$3
shift 3
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
prefix=$folder/there
cmake --install "$build" --prefix "$prefix" > /dev/null
found=$(dirname "$(find "$prefix" -name reynolds.pc)")
export PKG_CONFIG_PATH="$found"
libraries=$(dirname "$found")
for file in "$prefix/bin/reynolds" "$libraries/libreynolds.so" "$libraries/libreynolds.a"; do # without what debuggers read
    ! objdump -h "$file" | grep -q '\.debug_info' || { echo "$file has debug information"; exit 1; }
done
example=$source/examples/c/example.c
cp "$source/tests/cli/box.xml" "$folder/box.xml"

# Runs a program, whose name ends in what it is linked with, and compares what it prints with what the others printed.
run() {
    (cd "$folder" && LD_LIBRARY_PATH="$libraries" "$1" box.xml red.reflectance.value out.xml) > "$folder/now.txt"
    grep -q 'd sum(image) / d red.reflectance.value = [0-9]' "$folder/now.txt" || { cat "$folder/now.txt"; exit 1; }
    test -f "$folder/out.xml" || { echo "$1 wrote no scene"; exit 1; }
    rm "$folder/out.xml"
    test -f "$folder/first.txt" || cp "$folder/now.txt" "$folder/first.txt"
    cmp "$folder/first.txt" "$folder/now.txt"
    shared=$(LD_LIBRARY_PATH="$libraries" ldd "$1" | grep -c libreynolds || true)
    case $1 in
    *static) test "$shared" = 0 || { echo "$1 is linked with the shared library"; exit 1; } ;;
    *) test "$shared" = 1 || { echo "$1 is not linked with the shared library"; exit 1; } ;;
    esac
}

"$compiler" "$@" $(pkg-config --cflags reynolds) "$example" -o "$folder/with_shared" $(pkg-config --libs reynolds)
run "$folder/with_shared"
rest=$(pkg-config --static --libs reynolds | sed 's/-lreynolds//')
"$compiler" "$@" $(pkg-config --cflags reynolds) "$example" -o "$folder/with_static" "$libraries/libreynolds.a" $rest
run "$folder/with_static"

CFLAGS="$*" cmake -S "$source/tests/cli/install" -B "$folder/cmake" -DCMAKE_PREFIX_PATH="$prefix" -DEXAMPLE="$example" \
    -DCMAKE_C_COMPILER="$compiler" > "$folder/cmake.txt" || { cat "$folder/cmake.txt"; exit 1; }
cmake --build "$folder/cmake" > "$folder/cmake.txt" || { cat "$folder/cmake.txt"; exit 1; }
run "$folder/cmake/with_reynolds"
run "$folder/cmake/with_reynolds_static"

"$prefix/bin/reynolds" info "$folder/box.xml" > /dev/null
