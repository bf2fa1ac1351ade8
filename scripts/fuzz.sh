#!/bin/sh
# Runs every fuzz target for some seconds on the kept corpus, as many at once as asked; a crash ends it with an error.
# usage: fuzz.sh BUILD SECONDS JOBS
fuzz() {
    name=$(basename "$1" | sed 's/^fuzz_//')
    corpus=$(mktemp -d)
    for folder in tests/data/"$name" tests/data/"$name"/corpus tests/data/meshes tests/data/meshes/corpus tests/data/jobs; do
        [ -d "$folder" ] && find "$folder" -maxdepth 1 -type f -size -64k -exec cp -n {} "$corpus" \;
    done
    dictionary=
    [ -f "tests/fuzz/$name.dict" ] && dictionary="-dict=tests/fuzz/$name.dict"
    # What it prints stays together.
    "$1" -max_total_time="$2" -timeout=10 -rss_limit_mb=2048 -verbosity=0 $dictionary "$corpus" > "$corpus.log" 2>&1
    status=$?
    printf 'fuzz %s\n%s\n' "$name" "$(cat "$corpus.log")"
    rm -rf "$corpus" "$corpus.log"
    return $status
}

if [ "$1" = --one ]; then
    fuzz "$2" "$3"
else
    ls "$1"/bin/fuzz_* | xargs -P "$3" -I{} sh "$0" --one {} "$2"
fi
