#!/bin/sh
# Photographs the truth: target_0.exr to target_2.exr, with other random numbers than the recovery uses.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
spp=${3:-2048}
for sensor in 0 1 2; do
    "$reynolds" render "$folder/truth.xml" --sensor $sensor --spp "$spp" --seed $((1000 + sensor)) \
        -o "$folder/target_$sensor.exr" || exit 1
done
