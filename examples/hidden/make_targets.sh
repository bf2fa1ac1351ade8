#!/bin/sh
# Photographs the block: target_0.exr to target_11.exr, with other random numbers than the recovery uses. make_assets.py comes first.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
spp=${3:-16384}
sensor=0
while [ $sensor -lt 12 ]; do
    "$reynolds" render "$folder/truth_scene.xml" --sensor $sensor --spp "$spp" --seed $((1000 + sensor)) \
        -o "$folder/target_$sensor.exr" || exit 1
    sensor=$((sensor + 1))
done
