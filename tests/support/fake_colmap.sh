#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# fake_colmap.sh COMMAND OPTION...: stands for COLMAP 3.8 where tests need one that does as it is told. The folder
# $FAKE_COLMAP tells it:
#   registered.0, registered.1 ...  names of the photographs of each model that the mapper makes
#   fail_COMMAND                    print this and end with exit code 3
#   hang_COMMAND                    say `hanging`, then do nothing until killed
#   renamed                         options are called as in COLMAP 3.13
# Every call but --help is a line of $FAKE_COLMAP/calls.
set -eu
command=$1
shift

if [[ ${1:-} == --help ]]; then
    kind=Sift
    [[ ! -e $FAKE_COLMAP/renamed ]] || kind=Feature
    printf 'COLMAP 3.8 (a fake)\n\n'
    for option in "${kind}Extraction.use_gpu" "${kind}Extraction.num_threads" "${kind}Extraction.max_image_size" \
        SiftExtraction.max_num_features "${kind}Matching.use_gpu" "${kind}Matching.num_threads" \
        ExhaustiveMatching.block_size SequentialMatching.overlap SequentialMatching.quadratic_overlap \
        SpatialMatching.max_num_neighbors Mapper.num_threads; do
        printf '  --%s arg (=1)\n' "$option"
    done
    exit 0
fi

printf '%s\n' "$command $* [$QT_QPA_PLATFORM]" >>"$FAKE_COLMAP/calls"
declare -A value=()
while [[ $# -gt 1 ]]; do
    value[${1#--}]=$2
    shift 2
done

if [[ -e $FAKE_COLMAP/fail_$command ]]; then
    printf 'something went wrong:\n' >&2
    cat "$FAKE_COLMAP/fail_$command" >&2
    exit 3
fi
if [[ -e $FAKE_COLMAP/hang_$command ]]; then
    : >"$FAKE_COLMAP/hanging"
    exec sleep 60
fi

# number VALUE BYTES: below 256, little-endian
number() {
    printf "\\x$(printf %02x "$1")"
    head -c $(($2 - 1)) /dev/zero
}

case $command in
feature_extractor)
    total=$(wc -l <"${value[image_list_path]}")
    done=0
    while IFS= read -r name; do
        [[ -f ${value[image_path]}/$name ]]
        done=$((done + 1))
        printf 'Processed file [%d/%d]\n  Name:            %s\n  Features:        %d\n' $done "$total" "$name" 1000
    done <"${value[image_list_path]}"
    : >"${value[database_path]}"
    ;;
*_matcher)
    [[ -e ${value[database_path]} ]]
    printf 'Matching block [1/1, 1/1] in 0.001s\nMatching image [1/1] in 0.001s\n'
    ;;
mapper)
    printf '====\nInitializing with image pair #1 and #2\n====\n\nRegistering image #3 (3)\n'
    model=0
    while [[ -e $FAKE_COLMAP/registered.$model ]]; do
        folder=${value[output_path]}/$model
        mkdir "$folder"
        : >"$folder/cameras.bin"
        number $((10 + model)) 8 >"$folder/points3D.bin"
        {
            number "$(wc -l <"$FAKE_COLMAP/registered.$model")" 8
            id=0
            while IFS= read -r name; do
                id=$((id + 1))
                number $id 4
                printf '\0\0\0\0\0\0\xf0\x3f'  # quaternion 1, 0, 0, 0; translation 0
                head -c 48 /dev/zero
                number 1 4
                printf '%s\0' "$name"
                number 2 8  # two points seen
                head -c 48 /dev/zero
            done <"$FAKE_COLMAP/registered.$model"
        } >"$folder/images.bin"
        model=$((model + 1))
    done
    ;;
model_analyzer)
    printf 'Points: 10\nMean reprojection error: 0.625000px\n'
    ;;
esac
