#!/bin/sh
# Photographs the four slabs from both sides: target_0.exr to target_7.exr, with other random numbers than the recovery uses; and
# two of them with the liquid of dictionary_truth.xml, dictionary_0, 1, 6 and 7.exr. make_assets.py comes first.
# usage: make_targets.sh REYNOLDS [FOLDER] [SPP]
reynolds=$1
folder=${2:-$(dirname "$0")}
spp=${3:-4096}
for sensor in 0 1 2 3 4 5 6 7; do
    "$reynolds" render "$folder/scene.xml" -D milk=truth.xml --sensor $sensor --spp "$spp" --seed $((1000 + sensor)) \
        -o "$folder/target_$sensor.exr" || exit 1
done
for sensor in 0 1 6 7; do
    "$reynolds" render "$folder/scene.xml" -D milk=dictionary_truth.xml --sensor $sensor --spp "$spp" --seed $((2000 + sensor)) \
        -o "$folder/dictionary_$sensor.exr" || exit 1
done
