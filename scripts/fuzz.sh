#!/bin/sh
# Runs every fuzz target for some seconds on the kept corpus; a crash ends it with an error.
build=$1
seconds=$2
status=0
for target in "$build"/bin/fuzz_*; do
    name=$(basename "$target" | sed 's/^fuzz_//')
    corpus=$(mktemp -d)
    for folder in tests/data/"$name" tests/data/"$name"/corpus tests/data/meshes tests/data/meshes/corpus tests/data/jobs; do
        [ -d "$folder" ] && find "$folder" -maxdepth 1 -type f -size -64k -exec cp -n {} "$corpus" \;
    done
    dictionary=
    [ -f "tests/fuzz/$name.dict" ] && dictionary="-dict=tests/fuzz/$name.dict"
    echo "fuzz $name"
    "$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -verbosity=0 $dictionary "$corpus" || status=1
    rm -rf "$corpus"
done
exit $status
