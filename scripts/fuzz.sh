#!/bin/sh
# Runs a fuzz target for some seconds on the kept corpus; a crash ends it with an error.
# usage: fuzz.sh TARGET SECONDS
name=$(basename "$1" | sed 's/^fuzz_//')
corpus=$(mktemp -d)
for folder in tests/data/"$name" tests/data/"$name"/corpus tests/data/meshes tests/data/meshes/corpus tests/data/jobs; do
    [ -d "$folder" ] && find "$folder" -maxdepth 1 -type f -size -64k -exec cp -n {} "$corpus" \;
done
dictionary=
[ -f "tests/fuzz/$name.dict" ] && dictionary="-dict=tests/fuzz/$name.dict"
# Several run at once: what one of them prints stays together.
"$1" -max_total_time="$2" -timeout=10 -rss_limit_mb=2048 -verbosity=0 $dictionary "$corpus" > "$corpus.log" 2>&1
status=$?
printf 'fuzz %s\n%s\n' "$name" "$(cat "$corpus.log")"
rm -rf "$corpus" "$corpus.log"
exit $status
