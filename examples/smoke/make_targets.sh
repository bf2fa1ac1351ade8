#!/bin/sh
# Photographs the smoke: target_0.exr to target_19.exr, with other random numbers than the recovery uses. make_assets.py comes
# first.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
spp=${3:-512}
sensor=0
while [ $sensor -lt 20 ]; do
    "$reynolds" render "$folder/scene.xml" -D smoke=truth.vol --sensor $sensor --spp "$spp" --seed $((1000 + sensor)) \
        -o "$folder/target_$sensor.exr" || exit 1
    sensor=$((sensor + 1))
done
