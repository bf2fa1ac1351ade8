#!/bin/sh
# Photographs the truth: target_0.exr to target_11.exr, with other random numbers than the recovery uses.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
spp=${3:-256}
for sensor in 0 1 2 3 4 5 6 7 8 9 10 11; do
    "$reynolds" render "$folder/truth.xml" --sensor $sensor --spp "$spp" --seed $((1000 + sensor)) \
        -o "$folder/target_$sensor.exr" || exit 1
done
