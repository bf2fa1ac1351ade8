#!/bin/sh
# Photographs the room: target.exr, with other random numbers than the recovery uses.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
"$reynolds" render "$folder/truth_scene.xml" --spp "${3:-4096}" --seed 1000 -o "$folder/target.exr"
