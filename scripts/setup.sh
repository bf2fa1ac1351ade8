#!/bin/sh
# Installs those of the named Debian packages that are missing. Nothing to do: nothing done, no rights needed.
missing=
for package in "$@"; do
    state=$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null)
    [ "$state" = "install ok installed" ] || missing="$missing $package"
done
[ -z "$missing" ] && exit 0
echo "installing:$missing" >&2
run=
[ "$(id -u)" = 0 ] || run=sudo
$run apt-get update -qq >&2 && DEBIAN_FRONTEND=noninteractive $run apt-get install -y -qq $missing >&2 || {
    echo "setup: could not install:$missing" >&2
    exit 1
}
