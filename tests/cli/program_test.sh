#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# program_test.sh PROGRAM SCRATCH CASE: runs the program in an empty folder and checks what it does.
set -euo pipefail
program=$1
scratch=$2
case_name=$3
tests=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch"

# --- what a case can say ----------------------------------------------------------------------------------------

fail() {
    printf '%s\n' "FAILED: $*"
    if [[ -f out ]]; then sed 's/^/  out: /' out; fi
    if [[ -f err ]]; then sed 's/^/  err: /' err; fi
    exit 1
}

# expect CODE ARGUMENT...: runs the program; its words are in `out` and `err`.
expect() {
    local wanted=$1 code=0
    shift
    "$program" "$@" >out 2>err || code=$?
    [[ $code -eq $wanted ]] || fail "exit code $code, expected $wanted: nerfvdb $*"
}

says() { grep -qF -- "$2" "$1" || fail "$1 does not say '$2'"; }

# has_keys FILE KEY...: keys of a JSON file.
has_keys() {
    local file=$1 key
    shift
    for key in "$@"; do grep -q "\"$key\":" "$file" || fail "$file has no key $key: $(cat "$file")"; done
}

# number FILE KEY: a number in a JSON file.
number() { sed -nE "s/.*\"$2\": ([0-9.eE+-]+).*/\1/p" "$1"; }

readonly commands=(train eval render export mesh info synth bench prepare selftest)

# survived N WORDS: so many faults cost nothing. `./run stability` collects these lines.
survived() { printf '%s\n' "survived: $1 of $1 $2"; }

# A data set that trains in moments.
tiny_scene() { expect 0 synth sphere --out data --views 12 --val-views 0 --test-views 3 --width 48 --height 48 "$@"; }
tiny_model() { expect 0 train data --out model.vdb --steps 60 "$@"; }

# --- cases ------------------------------------------------------------------------------------------------------

test_help() {
    local command
    expect 0 --help
    for command in "${commands[@]}"; do
        says out "$command"
    done
    for command in "${commands[@]}"; do
        expect 0 "$command" --help
        says out "Example:"
        says out "  nerfvdb $command "
        says out "--threads"
        says out "--json"
    done
}

test_version() {
    expect 0 --version
    grep -qE '^nerfvdb [0-9]+\.[0-9]+\.[0-9]+$' out || fail "no version"
    expect 0 train --version
}

test_usage() {
    expect 2
    expect 2 fly
    says err "command: found 'fly'"
    expect 2 train
    expect 2 train data
    says err "--out"
    expect 2 train data --out model.vdb --fly
    says err "--fly"
    expect 2 train data --out model.vdb --time soon
    says err "--time: found 'soon', expected a duration such as 90, 90s, 5m or 1h"
    expect 2 train data --out model.vdb --steps 10,-3
    says err "--steps"
    expect 2 train data --out model.vdb --max-memory 4furlongs
    says err "--max-memory"
    expect 2 train data --out model.vdb --bounds 0 0 0 1 1
    expect 2 train data --out model.vdb --bounds 0 0 0 1 -1 1
    says err "--bounds"
    expect 2 train data --out model.vdb --preset slow
    expect 2 train data --out model.ply
    says err "ends in .vdb"
    expect 2 train data --out model.vdb --threads 0
    expect 2 eval model.vdb data --split evening
    expect 2 eval model.vdb data --every 0
    expect 2 eval model.vdb data --alpha-masks --no-alpha
    says err "--alpha-masks"
    expect 2 train data --out model.vdb $'--fly\x1b[31m'
    says err '--fly\x1b[31m'
    expect 2 render model.vdb
    says err "one of --data, --path and --orbit"
    expect 2 render model.vdb --orbit 3 --data data
    expect 2 synth cathedral --out data
    says err "cathedral"
    expect 2 synth sphere --out data --seed -1
    says err "--seed: found '-1', expected a whole number"
    expect 2 train data --out model.vdb --seed 18446744073709551616
    says err "--seed: found '18446744073709551616'"
    expect 2 mesh model.vdb --out mesh.fbx
    says err "mesh.fbx"
    expect 2 mesh model.vdb
    says err "--out"
    expect 2 mesh model.vdb --out mesh.ply --up y
    says err "--up"
    expect 2 mesh model.vdb --out mesh.ply --simplify 0
    says err "--simplify"
    expect 2 mesh model.vdb --out mesh.ply --faces 100 --simplify 0.5
    expect 1 mesh model.vdb --out mesh.ply --faces 0
    says err "--faces: found 0"
    [[ ! -e mesh.ply ]] || fail "a refused mesh was begun"
    [[ ! -e data ]] || fail "a refused command made a folder"
}

test_bad_input() {
    # Nothing there.
    expect 1 train nowhere --out model.vdb
    says err "nowhere"
    expect 1 info nowhere
    says err "nowhere"
    expect 1 eval nowhere.vdb data
    says err "nowhere.vdb"
    mkdir empty
    expect 1 train empty --out model.vdb
    says err "empty"
    [[ ! -e model.vdb ]] || fail "a model of nothing"

    # Pipes that nobody writes to are not waited for, whatever they pretend to be.
    mkdir pipes
    mkfifo pipe.vdb pipes/transforms.json
    for command in "info pipe.vdb" "info pipes" "eval pipe.vdb data" "train pipes --out model.vdb"; do
        # shellcheck disable=SC2086
        expect 1 $command
        says err "found a pipe or a device"
    done

    # Less memory than photographs need.
    tiny_scene --no-truth
    expect 2 train data --out model.vdb --steps 60 --max-memory 100KB
    says err "--max-memory"
    says err "photographs"
    [[ ! -e model.vdb ]] || fail "a model in no memory"

    # A file that is no model.
    printf 'this is no model\n' >text.vdb
    for command in "eval text.vdb data" "render text.vdb --orbit 2" "export text.vdb --out volume.vdb" \
        "mesh text.vdb --out mesh.ply" "info text.vdb"; do
        # shellcheck disable=SC2086
        expect 1 $command
        says err "text.vdb"
    done
    [[ "$(cat text.vdb)" == "this is no model" ]] || fail "the input was changed"
    [[ ! -e volume.vdb && ! -e mesh.ply ]] || fail "an output of nothing"

    # Places that cannot be written are refused before anything is read: the data set does not even exist.
    printf 'a file\n' >file
    expect 1 train nowhere --out file/model.vdb
    says err "--out file"
    mkdir folder.vdb
    expect 1 train nowhere --out folder.vdb
    says err "--out folder.vdb"
    mkdir model.ckpt
    expect 1 train nowhere --out model.vdb
    says err "--out model.ckpt"
    rmdir model.ckpt
    expect 1 train nowhere --out model.vdb --json file/results.json
    says err "--json file"
    expect 1 train empty --out model.vdb --resume
    says err "model.ckpt"

    # Camera paths that are none.
    tiny_scene --no-truth
    tiny_model
    printf '[1, 2]' >path.json
    expect 1 render model.vdb --path path.json --out pictures
    says err "path.json"
    says err "camera_path"
    printf '{"camera_path": [{"camera_to_world": [1, 2], "fov": 40}], "render_width": 8, "render_height": 8}' >path.json
    expect 1 render model.vdb --path path.json --out pictures
    says err "camera_path[0].camera_to_world: found 2 elements"
    printf '{"camera_path": [}' >path.json
    expect 1 render model.vdb --path path.json --out pictures
    says err "path.json"
    says err "line 1, column 18"

    # Voxels smaller than the model's file can say, refused before training.
    expect 1 train data --out tiny.vdb --steps 9 --bounds 0 0 0 1e-5 1e-5 1e-5
    says err "--bounds"
    says err "at least 2e-05"

    # A model cut short.
    head -c 2000 model.vdb >short.vdb
    expect 1 info short.vdb
    says err "short.vdb"

    # Results that find no room.
    if [[ -c /dev/full ]]; then
        local code=0
        "$program" info data >/dev/full 2>err || code=$?
        [[ $code -eq 1 ]] || fail "a full disk went unseen (exit code $code)"
    fi
}

test_synth() {
    tiny_scene --resolution 32 --json result.json
    has_keys result.json command scene views width height peak_memory_bytes
    for file in transforms_train.json transforms_test.json truth.vdb truth.ply; do
        [[ -s data/$file ]] || fail "no data/$file"
    done
    expect 0 info data --json -
    has_keys out kind splits train test views width height focal_length warnings
    says out '"alpha": true'
    expect 0 info data
    says out "val: none of its own; test serves"
    says out "warning: only 15 views"
    [[ $(grep -c warning out) -eq 1 ]] || fail "warned about nothing: $(cat out)"

    # A split's file stands for its folder.
    (cd data && expect 0 info transforms_test.json && says out "train: 12 of 48x48 views" && says out "test: 3 of 48x48 views")

    local name
    for name in shell thin glossy fog demo; do
        expect 0 synth "$name" --out "$name" --views 1 --val-views 0 --test-views 0 --width 16 --height 16 \
            --resolution 48 --json "$name.json"
        [[ -s $name/truth.vdb && -s $name/truth.ply ]] || fail "$name has no truth"
        has_keys "$name.json" truth_iso active_voxels
    done

    # Places without bounds: pictures without alpha, and no volume.
    for name in plaza street survey; do
        expect 0 synth "$name" --out "$name" --views 4 --val-views 0 --test-views 2 --width 24 --height 16 --json "$name.json"
        [[ -s $name/transforms_train.json && ! -e $name/truth.vdb ]] || fail "$name: $(ls "$name")"
        expect 0 info "$name" --json -
        says out '"alpha": false'
    done
    says street.json '"length": 200'
    expect 0 synth street --length 12 --out short --val-views 0 --test-views 0 --width 16 --height 16 --json short.json
    says short.json '"train": 7'
    expect 2 synth plaza --length 50 --out refused
    says err "--length"
    expect 2 synth street --length 5 --out refused
    says err "12 to 20000 m"
    expect 2 synth sphere --length 50 --out refused
    [[ ! -e refused ]] || fail "a refused command made a folder"
}

test_story() {
    tiny_scene --no-truth
    tiny_model --json train.json --seed 3
    has_keys train.json train_seconds cpu_seconds peak_memory_bytes active_voxels steps schedule train_psnr seed
    [[ -s model.vdb && -s model.ckpt ]] || fail "no model or no checkpoint"
    [[ "$(head -n 1 model.csv)" == "step,seconds,loss,psnr,rays,voxels,distortion,entropy,alpha_error" ]] || fail "model.csv has another head"
    [[ $(wc -l <model.csv) -ge 2 ]] || fail "model.csv is empty"

    expect 0 eval model.vdb data --split test --every 2 --json - --save views --beside beside
    has_keys out psnr ssim seconds_per_frame samples_per_ray views peak_memory_bytes rays_skipped_share \
        feature_share_of_dense
    [[ "$(ls views)" == $'0000.png\n0002.png' ]] || fail "--every 2 of 3 views saved: $(ls views)"
    [[ "$(ls beside)" == "$(ls views)" ]] || fail "beside the photographs: $(ls beside)"
    # Behind the signature and the head of a PNG: its width, three pictures of 48.
    [[ $(od -An -tu1 -j19 -N1 beside/0000.png | tr -d ' ') -eq 144 ]] || fail "not three pictures side by side"
    expect 2 eval model.vdb data --save views --beside ./views
    says err "another folder"

    expect 0 info model.vdb --json -
    has_keys out grids active_voxels leaves resolution bounds voxel_size memory_bytes
    says out '"name": "density"'
    expect 0 info model.vdb
    says out "cameras: 12 trained on, 3 held out"
    ! grep -q "$PWD" model.vdb || fail "the model tells where it was made"
    grep -qE '^grid density: float, [1-9][0-9]* active voxels \(a preview, half the resolution\)$' out || fail "no grid: $(cat out)"

    expect 0 eval model.vdb data --split test --debug-ray 0:12:12 --json -
    has_keys out samples transmittance decoded color
    expect 0 eval model.vdb data --debug-ray 0:12:12
    says out "light left"
    cp out half
    expect 0 eval model.vdb data --debug-ray 0:12:12:0.25
    ! cmp -s out half || fail "another jitter, the same samples"
    expect 2 eval model.vdb data --debug-ray 0:9999:0
    says err "--debug-ray"
    expect 0 render model.vdb --orbit 2 --width 32 --height 24 --out orbit --depth --opacity --normals
    [[ $(find orbit -name '000[01].*' | wc -l) -eq 14 ]] || fail "render wrote: $(ls orbit)"
    expect 0 render model.vdb --data data --split test --width 24 --out views24 --json -
    has_keys out seconds_per_frame views
    cat >path.json <<'JSON'
{"camera_type": "perspective", "render_width": 32, "render_height": 24, "camera_path": [
  {"camera_to_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1], "fov": 40, "aspect": 1.3333}]}
JSON
    expect 0 render model.vdb --path path.json --out path
    [[ -s path/0000.png ]] || fail "no picture of the path"

    expect 0 export model.vdb --out volume.vdb --fit 100 --json -
    has_keys out active_voxels file_bytes
    expect 2 export model.vdb --out model.vdb
    expect 0 mesh model.vdb --out mesh.ply --json -
    has_keys out vertices faces iso closed
    expect 0 mesh model.vdb --out mesh.obj --no-colours --keep-largest 1 --fill-inside
    expect 1 mesh model.vdb --out none.ply --fill-inside --iso 1e9
    says err "field's maximum"
    [[ ! -e none.ply ]] || fail "a surface where there is none"
    expect 0 mesh model.vdb --out mesh.glb --up y --smooth 3 --faces 500 --json -
    has_keys out faces dropped_pieces dropped_faces largest_piece_faces closed
    says out '"closed": true'
    expect 0 mesh model.vdb --out mesh.stl --keep-islands --simplify 0.5
    expect 0 mesh model.vdb --compare mesh.ply --json -
    has_keys out comparison world voxels accuracy completeness chamfer f_score normal_consistency
    expect 0 mesh model.vdb --compare mesh.ply
    says out "F-score at one voxel: 1.0000"
    expect 1 mesh model.vdb --compare absent.ply
    says err "absent.ply"
    [[ -s mesh.glb && -s mesh.stl ]] || fail "a mesh is missing"
    expect 0 train data --out sized.vdb --voxel-size 0.05 --steps 60
    expect 0 info sized.vdb
    says out "voxels of 0.05 world units"
    expect 2 train data --out sized.vdb --voxel-size 50 --steps 60
    says err "--voxel-size: found 50 world units"
    expect 2 train data --out sized.vdb --voxel-size 0.05 --steps 60,60,60,60,60,60,60
    says err "--steps: found 7 stages"
    expect 0 mesh model.vdb --out whole.ply --keep-islands --no-colours
    expect 0 mesh model.vdb --out streamed.ply --stream --no-colours
    cmp whole.ply streamed.ply || fail "a stream is another mesh"
    # Sixty steps make but a haze: at the density that --iso auto asks for, little of it is left at coarse voxels.
    expect 0 mesh model.vdb --out coarse.ply --iso 5 --resolution 90 --bounds=-1,-1,-1,1,1,0.2 --method dual --adaptivity 0.1
    expect 2 mesh model.vdb --out mesh.ply --bounds 0,0,0,0,1,1
    says err "--bounds"
    expect 2 mesh model.vdb --out nothing.ply --bounds 100,100,100,101,101,101
    expect 2 mesh model.vdb --out mesh.ply --stream --min-faces 9
    says err "--stream"
    expect 0 mesh model.vdb --out moved.ply --origin 100,-50,7 --json moved.json
    says moved.json '"origin"'
    expect 0 mesh model.vdb --compare moved.ply --origin 100,-50,7 --json moved.json
    awk -F'[:,]' '/"chamfer"/ { exit !($2 < 1e-3) }' moved.json || fail "moved twice: $(cat moved.json)"
    expect 0 mesh model.vdb --compare moved.ply --json moved.json
    awk -F'[:,]' '/"chamfer"/ { exit !($2 > 10) }' moved.json || fail "not moved: $(cat moved.json)"
    expect 2 mesh model.vdb --out mesh.ply --compare mesh.ply
    says err "it would be overwritten"
    expect 1 mesh model.vdb --out none.ply --min-faces 100000000
    says err "all too small to be kept"
    expect 1 mesh model.vdb --out none.ply --faces -5
    says err "--faces: found -5"
    [[ ! -e none.ply ]] || fail "a mesh of nothing"
    [[ -s volume.vdb && -s mesh.ply && -s mesh.obj ]] || fail "an export is missing"
    expect 0 info volume.vdb --json -
    has_keys out kind grids type class active_voxels dims voxel_size bounds file_bytes
    expect 0 info volume.vdb
    says out "grid density: float, fog volume, "
    says out "grid color: vec3s"
    head -c $(($(bytes volume.vdb) - 100)) volume.vdb >short.vdb
    expect 1 info short.vdb
    says err "short.vdb: found damaged or truncated content"
    expect 2 info volume.vdb --plot cameras.svg
    says err "--plot"
}

test_info() {
    tiny_scene --no-truth
    expect 0 info data --plot cameras.svg --json -
    has_keys out splits views sizes lenses focal_length alpha camera_bounds coverage middle see_middle \
        mean_angle_degrees widest_angle_degrees position_spread position_rank unusable alone duplicates scene_box warnings
    says out '"see_middle": 15'
    grep -qF '</svg>' cameras.svg || fail "no picture of the cameras"
    expect 0 info data
    says out "train: 12 of 48x48 views, alpha, one lens"
    says out "coverage: 15 of 15 see the middle, [0, 0, 0]"
    says out "scene box: ["
    says out "warning: only 15 views"

    # A mirrored pose is refused by training, and named beside all the rest here.
    sed -i -E '0,/"transform_matrix"/s//"transform_matrix": [[-1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]], "was"/' \
        data/transforms_train.json
    expect 1 train data --out model.vdb
    says err "pose is a mirror"
    expect 0 info data --json -
    says out "pose is a mirror"
    says out '"scene_box": null'
    expect 0 info data
    says out "warning: 1 of 15 cameras are unusable, and training will refuse them: train/r_0.png: pose is a mirror"
}

# with_fake_colmap: a COLMAP that does as the folder `fake` tells, first on PATH.
with_fake_colmap() {
    mkdir -p bin fake
    ln -s "$tests/../support/fake_colmap.sh" bin/colmap
    export FAKE_COLMAP=$PWD/fake
    PATH=$PWD/bin:$PATH
}

test_prepare() {
    local code=0 waited=0 pid
    tiny_scene --no-truth
    mv data/train photos
    rm -r data
    PATH=$scratch/nothing expect 1 prepare photos --out data
    says err "colmap: found no such program on PATH"
    says err "sudo apt install colmap"
    [[ ! -e data ]] || fail "a folder was begun without COLMAP"

    with_fake_colmap
    (cd photos && ls | grep -v r_3.png) >fake/registered.0
    touch fake/hang_mapper
    "$program" prepare photos --out data >out 2>err &
    pid=$!
    until [[ -e fake/hanging ]] || (( waited++ > 600 )); do sleep 0.1; done
    kill -INT $pid
    wait $pid || code=$?
    [[ $code -eq 130 ]] || fail "exit code $code after an interrupt, expected 130"
    says err "stopped while mapping"
    says err "the same command goes on"

    rm fake/hang_mapper fake/calls
    expect 0 prepare photos --out data --json -
    has_keys out photographs registered unregistered models points reprojection_error_pixels matching matching_reason \
        pairs shared_camera predicted_seconds seconds
    says out '"r_3.png"'
    says err "warning: 1 of 12 photographs have no camera in it: r_3.png"
    [[ "$(cut -d' ' -f1 fake/calls)" == $'mapper\nmodel_analyzer' ]] || fail "calls: $(cat fake/calls)"
    [[ -s data/sparse/0/images.bin && photos/r_3.png -ef data/images/r_3.png ]] || fail "no data set: $(find data)"
    expect 0 prepare photos --out data
    says out "data: 11 of 12 photographs have a camera"
    expect 1 prepare photos --out data --max-size 500
    says err "--force"
    printf 'it went wrong\n' >fake/fail_sequential_matcher
    expect 1 prepare photos --out data --force --matching sequential
    says err "colmap: it went wrong"
    says err "matching.log: found that 'colmap sequential_matcher' ended with exit code 3"
    touch walk.mp4
    expect 1 prepare walk.mp4 --out other
    says err "ffmpeg -i 'walk.mp4'"
    expect 2 prepare photos --out data --matching all
}

# foreign_volume FILE PYTHON...: a volume as another program writes it; the words act on a FloatGrid `fog`.
foreign_volume() {
    local file=$1
    shift
    "$python" -c "import pyopenvdb as vdb
fog = vdb.FloatGrid()
fog.name = 'density'
fog.gridClass = vdb.GridClass.FOG_VOLUME
fog.fill((-12, -12, -12), (11, 11, 11), 4.0)
fog.transform = vdb.createLinearTransform(voxelSize=0.05)
$*
vdb.write('$file', grids=[fog])" || fail "no foreign volume $file"
}

test_volumes() {
    local bad python
    tiny_scene --no-truth
    tiny_model
    expect 0 export model.vdb --out volume.vdb --fit 100 --finer 1

    # An export is shown and scored as a model is, and nearly as well as one that has no view-dependence.
    expect 0 eval volume.vdb data --split test --json volume.json --save views
    has_keys volume.json psnr ssim seconds_per_frame samples_per_ray views
    [[ "$(ls views)" == $'0000.png\n0001.png\n0002.png' ]] || fail "saved: $(ls views)"
    expect 0 eval model.vdb data --split test --no-view-dependence --json flat.json
    psnr_of() { sed -nE 's/^  "psnr": ([0-9.]+),?$/\1/p' "$1"; }
    awk -v volume="$(psnr_of volume.json)" -v flat="$(psnr_of flat.json)" \
        'BEGIN { exit !(volume > 12 && flat > 12 && volume > flat - 2) }' ||
        fail "PSNR of the volume $(psnr_of volume.json), of the model $(psnr_of flat.json)"
    expect 0 render volume.vdb --orbit 2 --width 32 --height 24 --out orbit --depth --opacity --normals
    [[ $(find orbit -name '000[01].*' | wc -l) -eq 14 ]] || fail "render wrote: $(ls orbit)"

    # What is behind it: noted in the file, until another is asked for.
    expect 0 render volume.vdb --orbit 1 --width 16 --height 16 --out as_noted
    expect 0 render volume.vdb --orbit 1 --width 16 --height 16 --out white --background white
    expect 0 render volume.vdb --orbit 1 --width 16 --height 16 --out red --background 1,0,0
    cmp as_noted/0000.png white/0000.png || fail "the background of training was lost"
    if cmp -s white/0000.png red/0000.png; then fail "--background changes nothing"; fi
    expect 2 render volume.vdb --orbit 1 --background crimson
    says err "--background: found 'crimson', expected white, black or three numbers from 0 to 1"
    expect 2 eval volume.vdb data --background 0,0,2
    says err "--background"

    # Damaged, and no volume at all.
    head -c $(($(bytes volume.vdb) - 100)) volume.vdb >short.vdb
    for bad in "eval short.vdb data" "render short.vdb --orbit 2 --out bad"; do
        # shellcheck disable=SC2086
        expect 1 $bad
        says err "short.vdb: found damaged or truncated content (it does not match its checksum)"
    done
    [[ ! -e bad/0000.png ]] || fail "a picture of a damaged volume"

    python=$(with_pyopenvdb)
    if [[ -z "$python" ]]; then
        echo "without other programs' volumes: no pyopenvdb here"
        return
    fi
    foreign_volume fog.vdb "fog.name = 'smoke'"
    expect 0 render fog.vdb --orbit 1 --width 16 --height 16 --out fog --background black
    [[ -s fog/0000.png ]] || fail "no picture of another program's volume"
    expect 0 eval fog.vdb data --split test
    says out "3 views: PSNR"
    foreign_volume surface.vdb "fog.gridClass = vdb.GridClass.LEVEL_SET"
    expect 1 render surface.vdb --orbit 1 --out bad
    says err "surface.vdb: density: found a level set, which holds distances, expected a fog volume"
    foreign_volume negative.vdb "fog.fill((0, 0, 0), (3, 3, 3), -1.0)"
    expect 1 eval negative.vdb data
    says err "negative.vdb: a voxel of the leaf at index (0, 0, 0): found a density or colour that is negative"
    foreign_volume huge.vdb "fog.fill((0, 0, 0), (8191, 8191, 8191), 1.0)"
    expect 1 render huge.vdb --orbit 1 --out bad
    says err "huge.vdb: density: found 549755"
    [[ ! -e bad/0000.png ]] || fail "a picture of no volume"
}

test_bench() {
    tiny_scene --no-truth
    tiny_model
    expect 0 bench render model.vdb --data data --repeats 1 --views 1 --out results --json -
    has_keys out kind facts columns rows cpu simd_target commit
    says out '"psnr_finest"'
    expect 0 bench skip model.vdb --data data --repeats 1 --views 1 --out results
    says out "empty voxels"
    expect 0 bench scaling model.vdb --repeats 1 --views 1 --out results
    says out "serial share"
    expect 0 bench quality data --times 1s --out results
    says out "psnr"
    for kind in render skip scaling quality; do
        [[ -s results/$kind.json && -s results/$kind.csv && -s results/$kind.svg ]] || fail "$kind: $(ls results)"
    done
    [[ $(find results -name '.*' -type d | wc -l) -eq 0 ]] || fail "left behind: $(ls -A results)"

    expect 0 bench compare results/render.json results/render.json
    says out "0 worse"
    sed -E 's/"min_difference": 0.05/"min_difference": 0.001/' results/render.json >before.json
    sed -E 's/"psnr_finest"/"psnr_photos_"/; s/"psnr_photos"/"psnr_finest"/; s/"psnr_photos_"/"psnr_photos"/' \
        before.json >after.json
    expect 1 bench compare before.json after.json
    says out "worse: "
    expect 1 bench compare results/render.json results/skip.json
    says err "two results of one kind"
    expect 1 bench compare results/render.json nowhere.json
    expect 1 bench render nowhere.vdb
    says err "nowhere.vdb"
    expect 2 bench fly
    expect 2 bench quality data --presets slow
    expect 2 bench quality data --times soon
    says err "--times"
}

test_threads() {
    tiny_scene --no-truth
    expect 0 train data --out one.vdb --steps 12,12,12 --threads 1
    expect 0 train data --out two.vdb --steps 12,12,12 --threads 2
    cmp one.vdb two.vdb || fail "the model depends on the number of threads"
    expect 0 train data --out other.vdb --steps 12,12,12 --seed 2
    if cmp -s one.vdb other.vdb; then fail "the seed changes nothing"; fi

    # Every instruction set that there is scores the same, to a hundredth of a decibel.
    expect 2 info data --simd ABACUS
    says err "--simd"
    local sets set
    sets=$(sed -n 's/.*{\(.*\)}.*/\1/p' err | tr , ' ')
    [[ $(wc -w <<<"$sets") -ge 1 ]] || fail "no instruction set is named"
    for set in $sets; do
        expect 0 eval one.vdb data --simd "$set" --json "$set.json"
    done
    for set in $sets; do sed -n 's/^  "psnr": \([0-9.]*\).*/\1/p' "$set.json"; done >scores
    awk 'NR == 1 { low = high = $1 }
         { if ($1 < low) low = $1; if ($1 > high) high = $1 }
         END { exit !(NR > 0 && high - low < 0.01) }' scores || fail "instruction sets differ: $(cat scores)"
}

# A scene in two blocks is one scene to every command.
# flip FILE AT BIT COPY: one bit of a copy is another.
flip() {
    local byte
    cp "$1" "$4"
    byte=$(od -An -tu1 -j"$2" -N1 "$1")
    printf "\\$(printf %03o $((byte ^ 1 << $3)))" | dd of="$4" bs=1 seek="$2" conv=notrunc status=none
}

# sentence_or_success ARGUMENT...: exit code 0, or 1 with a sentence; never a signal.
sentence_or_success() {
    local code=0
    "$program" "$@" >out 2>err || code=$?
    [[ $code -eq 0 || $code -eq 1 ]] || fail "exit code $code: nerfvdb $*"
    [[ $code -eq 0 ]] || LC_ALL=C grep -aq '^nerfvdb: .*found .*, expected ' err || fail "no sentence: nerfvdb $*"
}

# .vdb files that no checksum guards, damaged.
test_foreign_volumes() {
    local size i tried=0
    tiny_scene --no-truth
    tiny_model
    expect 0 export model.vdb --out ours.vdb --max-resolution 16 --fit 0 --volume-only
    cp ours.vdb theirs.vdb
    printf 4 | dd of=theirs.vdb bs=1 seek=35 conv=notrunc status=none  # a random UUID, as OpenVDB makes them
    expect 0 info theirs.vdb
    says out "grid density: float, fog volume"
    size=$(stat -c %s theirs.vdb)
    for ((i = 0; i < 64; ++i)); do
        head -c $((size * i / 64)) theirs.vdb >short.vdb
        sentence_or_success info short.vdb
        tried=$((tried + 1))
        if ((i < 63)); then [[ -s err ]] || fail "a file cut at $i / 64 was read"; fi
        ((i % 4 == 0)) || continue
        # Header and trees stand at the front: every other bit is one of theirs.
        flip theirs.vdb $((i % 8 ? 57 + 7 * i : size * i / 64)) $((i / 4 % 8)) flipped.vdb
        sentence_or_success info flipped.vdb
        tried=$((tried + 1))
    done
    for ((i = 2; i < 8; i += 2)); do
        head -c $((size * i / 8)) theirs.vdb >short.vdb
        expect 1 render short.vdb --out pictures --orbit 1 --width 8 --height 8
        flip theirs.vdb $((size * i / 8)) $i flipped.vdb
        sentence_or_success render flipped.vdb --out pictures --orbit 1 --width 8 --height 8
        tried=$((tried + 2))
    done
    survived $tried "damaged volumes without a checksum: success or a sentence"
}

test_blocks() {
    tiny_scene --no-truth
    expect 0 train data --out parts --blocks 2x1 --steps 90 --json train.json
    has_keys train.json trained blocks peak_memory_bytes
    [[ "$(ls parts)" == $'block_0_0.csv\nblock_0_0.vdb\nblock_1_0.csv\nblock_1_0.vdb\nblocks.json' ]] ||
        fail "a folder of blocks holds: $(ls parts)"

    # Each block by itself, as another machine would, in another order: the same files.
    expect 0 train data --out alone --blocks 2x1 --block 1,0 --steps 90
    [[ ! -e alone/block_0_0.vdb ]] || fail "--block trained another block"
    expect 1 render alone --data data --out half
    says err "block_0_0.vdb: found no file"
    expect 0 info alone
    says out "block 0,0: "
    says out "not trained"
    expect 0 train data --out alone --blocks 2x1 --steps 90 --resume
    says err "block 1,0 is there already"
    local file
    for file in block_0_0.vdb block_1_0.vdb blocks.json; do
        cmp "parts/$file" "alone/$file" || fail "trained alone, $file is another"
    done

    expect 2 train data --out parts --blocks 1x2 --steps 90
    says err "cut in another way"
    expect 2 train data --out parts.vdb --blocks 2x1 --steps 90
    says err "a folder"
    expect 2 train data --out other --block 0,0
    says err "--blocks"
    expect 2 train data --out other --blocks 2x1 --block 2,0 --steps 90
    says err "0,0 to 1,0"
    expect 2 train data --out other --blocks 30x30 --steps 90
    says err "found 30x30, none with three photographs"
    [[ ! -e other/blocks.json ]] || fail "what was refused says how the scene is cut"
    expect 2 train data --out other --blocks 2x1 --scene box
    says err "--scene"
    expect 2 train data --out other --blocks 2x1 --voxel-size 0.1
    says err "--voxel-size"
    expect 2 train data --out other --blocks 2by1
    says err "such as 3x2"

    expect 0 info parts --json -
    has_keys out kind blocks up_axis models bounds
    expect 0 info parts
    says out "block 1,0: "
    says out " trained, "
    expect 0 eval parts data --split test --json eval.json
    has_keys eval.json psnr
    expect 2 eval parts data --debug-ray 0:12:12
    says err "a folder of blocks"
    # Worse than 15 dB is a picture of nothing: the photographs themselves differ from white by 13.
    awk -F'[:,]' '/"psnr"/ { exit !($2 > 15) }' eval.json || fail "blocks show something else: $(head -5 eval.json)"
    expect 0 render parts --data data --split test --width 24 --out views --depth
    expect 0 render parts/blocks.json --orbit 2 --width 24 --height 24 --out orbit
    [[ -s views/0000.png && -s orbit/0001.png ]] || fail "no pictures of blocks"

    expect 0 export parts --out volume.vdb --fit 20 --max-resolution 64 --json -
    has_keys out each_block block active_voxels
    [[ -s volume.block0_0.vdb && -s volume.block1_0.vdb && ! -e volume.vdb ]] || fail "blocks left as: $(ls volume.*)"
    says volume.blender.py "volume.block0_0.vdb"
    [[ $(grep -c '"file_path"' volume.cameras.json) -eq 15 ]] || fail "cameras are told twice, or not at all"
    expect 2 export parts --out volume.vdb --level-set
    expect 0 mesh parts --out mesh.ply --json -
    says out '"closed": true'
    expect 2 mesh parts --out mesh.ply --shells 2
    says err "--shells"
    expect 2 mesh parts --out mesh.ply --stream
    says err "--no-colours"
    expect 0 mesh parts --out streamed.ply --stream --no-colours
    expect 0 mesh parts --out moved.ply --origin 100,-50,7 --bounds=-1,-1,-1,1,1,1
    expect 0 mesh parts --compare moved.ply --origin 100,-50,7 --bounds=-1,-1,-1,1,1,1 --json moved.json
    awk -F'[:,]' '/"chamfer"/ { exit !($2 < 1e-3) }' moved.json || fail "moved twice: $(cat moved.json)"
}

test_photographs() {
    local file number
    tiny_scene --no-truth
    tiny_model --json train.json
    has_keys train.json downscale masked_share exposure_learned exposure_gains
    says train.json '"exposure_learned": false'

    # Photographs that are read from disk teach the same; nothing is left there.
    expect 0 train data --out cached.vdb --steps 60 --cache scratch --json cached.json
    says err "photographs of 0 MiB are kept on disk, in scratch"
    says cached.json "read from a cache on disk"
    cmp cached.vdb model.vdb || fail "photographs on disk teach something else"
    [[ -z "$(ls -A scratch)" ]] || fail "left in the cache: $(ls -A scratch)"
    expect 1 train data --out cached.vdb --steps 60 --cache data/transforms_train.json
    says err "--cache"

    # Exposure, and photographs of half the size.
    expect 0 train data --out exposed.vdb --steps 60 --exposure on --json exposed.json
    says exposed.json '"exposure_learned": true'
    ! cmp -s exposed.vdb model.vdb || fail "--exposure on learned nothing"
    expect 0 train data --out small.vdb --steps 60 --downscale 2 --json small.json
    says small.json '"downscale": 2'
    expect 1 train data --out small.vdb --resume
    says err "other cameras or photographs"
    expect 0 eval small.vdb data --downscale 2 --save views --json eval.json
    says eval.json '"downscale": 2'
    expect 2 train data --out small.vdb --steps 60 --downscale 3
    says err "--downscale"

    # Masks: where the model is opaque.
    local split
    for split in train test; do
        expect 0 render model.vdb --data data --split $split --opacity --out opacity
        mkdir -p data/masks/$split
        for file in opacity/*.opacity.png; do
            number=$(basename "$file" .opacity.png)
            mv "$file" data/masks/$split/r_$((10#$number)).png
        done
    done
    expect 0 train data --out masked.vdb --steps 60 --json masked.json
    says err "masks leave out"
    ! grep -q '"masked_share": 0.0' masked.json || fail "nothing was masked"
    expect 0 eval masked.vdb data
    says out "% of the pixels are masked and were not compared"
    expect 0 train data --out all.vdb --steps 60 --no-masks
    cmp all.vdb model.vdb || fail "--no-masks left something out"
    expect 0 eval masked.vdb data --no-masks
    ! grep -q "masked" out || fail "--no-masks left something out"
    expect 0 info data
    says out "12 of 48x48 views, alpha, 12 with masks"
    expect 0 train data --out by_alpha.vdb --steps 60 --alpha-masks --no-masks --json by_alpha.json
    says err "masks leave out"
    expect 0 eval by_alpha.vdb data --alpha-masks --no-masks
    says out "% of the pixels are masked and were not compared"
    printf 'no picture' >data/masks/train/r_3.png
    expect 1 train data --out bad.vdb --steps 60
    says err "masks/train/r_3.png"
}

test_interrupt() {
    local code waited pid signal
    tiny_scene --no-truth
    for signal in INT TERM; do
        rm -f model.*
        "$program" train data --out model.vdb --steps 10000000 >out 2>err &
        pid=$!
        # The first line of the log says that training has begun.
        waited=0
        until [[ -s model.csv.part ]] || (( waited++ > 600 )); do sleep 0.1; done
        kill -$signal $pid
        code=0
        wait $pid || code=$?
        [[ $code -eq 130 ]] || fail "exit code $code after SIG$signal, expected 130"
        says err "nerfvdb train data --out model.vdb --resume goes on"
        [[ -s model.csv && ! -e model.csv.part ]] || fail "the log has not taken its name"
        [[ -s model.ckpt ]] || fail "no checkpoint after SIG$signal"
        expect 0 eval model.vdb data
    done
    survived 2 "signals (SIGINT, SIGTERM): saved, exit code 130"
}

test_resume() {
    local option
    tiny_scene --no-truth
    tiny_model --seed 3
    cp model.vdb first.vdb
    for option in "--preset default" "--time 5s" "--steps 60" "--background auto" "--exposure off" \
        "--bounds -1 -1 -1 1 1 1" "--seed 3"; do
        # shellcheck disable=SC2086
        expect 2 train data --out model.vdb --resume $option
        says err "--resume: found ${option%% *} too"
        says err "leave out ${option%% *}"
    done
    expect 0 synth shell --out other --views 12 --val-views 0 --test-views 3 --width 48 --height 48 --no-truth
    expect 1 train other --out model.vdb --resume
    says err "model.ckpt: found training on other cameras or photographs, expected those of other"
    cmp model.vdb first.vdb || fail "a refused command changed the model"

    # Nothing is left to learn: the same model again, its cameras too.
    expect 0 train data --out model.vdb --resume
    cmp model.vdb first.vdb || fail "resuming a run that was over changed the model"
}

# with_pyopenvdb: a Python that has OpenVDB's module, or nothing. A user's own Python may stand before the system's.
with_pyopenvdb() {
    local python
    for python in python3 /usr/bin/python3; do
        if "$python" -c 'import pyopenvdb' >/dev/null 2>&1; then
            echo "$python"
            return
        fi
    done
}

test_openvdb_tools() {
    local python file
    python=$(with_pyopenvdb)
    if [[ -z "$python" ]] && ! command -v vdb_print >/dev/null; then
        echo "skipped: neither vdb_print nor pyopenvdb here"
        exit 77
    fi
    tiny_scene --no-truth
    tiny_model
    expect 0 export model.vdb --out volume.vdb --fit 100 --finer 1
    expect 0 export model.vdb --out grey.vdb --color none
    for file in model.vdb volume.vdb grey.vdb; do
        if command -v vdb_print >/dev/null; then
            vdb_print -l -m $file >out 2>err || fail "vdb_print refuses $file"
            says out "density"
            says out "fog volume"
        fi
        if [[ -n "$python" ]]; then
            "$python" -c "import pyopenvdb, sys
print(*sorted(f'{grid.name}:{grid.valueTypeName}' for grid in pyopenvdb.readAll('$file')[0]))" >out 2>err ||
                fail "pyopenvdb refuses $file"
            says out "density:float"
            if [[ $file == volume.vdb ]]; then says out "color:vec3s"; fi
        fi
    done
}

# in_blender VOLUME GRIDS CAMERA MESH...: Blender shows a volume as the program's own picture does, from the camera
# that comes first among the held-out ones, CAMERA in the exported file; and opens meshes.
in_blender() {
    local stem=${1%.vdb} grids=$2 camera=$3
    shift 3
    # Cameras name photographs of the data set.
    cp "$stem.cameras.json" "data/$stem.json"
    expect 0 render "$stem.vdb" --data "data/$stem.json" --split test --out "$stem" --opacity --width 480
    blender --background --factory-startup --python-exit-code 1 --python "$tests/../export/blender_picture.py" -- \
        "$stem.blender.py" "$grids" "$camera" "$stem/0000.png" "$stem/0000.opacity.png" "$@" >out 2>err ||
        fail "Blender shows something else"
    grep -E "IoU|faces" out
}

test_blender() {
    if ! command -v blender >/dev/null; then
        echo "skipped: no blender here"
        exit 77
    fi
    expect 0 synth demo --out data --views 24 --val-views 0 --test-views 2 --width 120 --height 120 --no-truth
    expect 0 train data --out model.vdb --preset fast --steps 4000
    expect 0 mesh model.vdb --out mesh.ply
    expect 0 mesh model.vdb --out mesh.obj

    expect 0 export model.vdb --out volume.vdb --fit 100 --finer 1
    in_blender volume.vdb color:VECTOR_FLOAT,density:FLOAT 24 mesh.ply mesh.obj
    expect 0 export model.vdb --out tipped.vdb --scale 10 --up y --center --fit 100 --finer 1
    in_blender tipped.vdb color:VECTOR_FLOAT,density:FLOAT 24
}

# bytes FILE
bytes() { wc -c <"$1"; }

# on_small_disk KILOBYTES COMMAND...: no file can grow beyond a size.
on_small_disk() (
    ulimit -f "$1"
    shift
    "$@"
)

# silently CODE ARGUMENT...: as expect, with nowhere to write the words.
silently() {
    local wanted=$1 code=0
    shift
    "$program" "$@" >/dev/null 2>&1 || code=$?
    [[ $code -eq $wanted ]] || fail "exit code $code, expected $wanted: nerfvdb $*"
}

test_full_disk() {
    local file
    tiny_scene --no-truth
    tiny_model

    # Room for the model, not for its checkpoint: the model is kept.
    local between=$((($(bytes model.vdb) + $(bytes model.ckpt)) / 2 / 1024))
    on_small_disk $between expect 1 train data --out tight.vdb --steps 60
    says err "nerfvdb: saved tight.vdb, but not its checkpoint: tight.ckpt: found File too large"
    cmp tight.vdb model.vdb || fail "another model where the checkpoint found no room"
    [[ ! -e tight.ckpt ]] || fail "half a checkpoint"

    # No room at all: what an earlier run left is as it was.
    mkdir earlier
    cp model.* earlier
    on_small_disk 2 expect 1 train data --out model.vdb --steps 60 --seed 2
    says err "model.vdb"
    for file in model.vdb model.ckpt model.csv; do
        cmp $file earlier/$file || fail "a failed run changed $file"
    done
    [[ -z "$(find . -name '*.part*')" ]] || fail "left behind: $(ls)"
    survived 2 "full disks while training"
}

# Commands that write, as lines "OUTPUT WORDS...": what stands at OUTPUT must survive what goes wrong.
readonly writers="\
volume.vdb export model.vdb --out volume.vdb --fit 0
mesh.ply mesh model.vdb --out mesh.ply
mesh.obj mesh model.vdb --out mesh.obj
mesh.glb mesh model.vdb --out mesh.glb
mesh.stl mesh model.vdb --out mesh.stl
views/0000.png render model.vdb --data data --split test --out views
orbit/0000.png render model.vdb --orbit 1 --width 200 --height 200 --out orbit
saved/0000.png eval model.vdb data --save saved
beside/0000.png eval model.vdb data --beside beside
scores.json eval model.vdb data --json scores.json
made/transforms_train.json synth sphere --out made --views 2 --val-views 0 --test-views 0 --width 48 --height 48 --no-truth"

test_full_disk_others() {
    local output words tried=0
    tiny_scene --no-truth
    tiny_model
    while read -r output words; do
        # shellcheck disable=SC2086
        expect 0 $words
        [[ -s $output ]] || fail "no $output"
        cp "$output" earlier
        # No file can have a byte.
        # shellcheck disable=SC2086
        on_small_disk 0 silently 1 $words
        cmp "$output" earlier || fail "a full disk cost $output"
        [[ -z "$(find . -name '*.part*')" ]] || fail "left behind by $words: $(find . -name '*.part*')"
        tried=$((tried + 1))
        # A little, but not enough.
        if (($(bytes "$output") > 2048)); then
            # shellcheck disable=SC2086
            on_small_disk 1 expect 1 $words
            says err "$output"
            cmp "$output" earlier || fail "a disk that was nearly full cost $output"
            [[ -z "$(find . -name '*.part*')" ]] || fail "left behind by $words: $(find . -name '*.part*')"
            tried=$((tried + 1))
        fi
    done <<<"$writers"
    survived $tried "full disks while other files were written"
}

test_bad_places() {
    local output words name place tried=0
    tiny_scene --no-truth
    tiny_model
    while read -r output words; do
        name=${output%%/*}
        rm -rf "$name"
        if [[ $name == "$output" ]]; then mkdir "$name"; else printf 'a file\n' >"$name"; fi
        # shellcheck disable=SC2086
        expect 1 $words
        says err "$name"
        # Nobody may write there, whoever runs the tests.
        place=/proc/$name
        # shellcheck disable=SC2086
        expect 1 ${words// $name/ $place}
        says err "/proc"
        if [[ $name == "$output" ]]; then rmdir "$name"; else [[ "$(cat "$name")" == "a file" ]] || fail "$name was a file"; fi
        rm -rf "$name"
        tried=$((tried + 2))
    done <<<"$writers"
    # What lies beside a volume is looked at before the volume is made.
    for name in volume.cameras.json volume.blender.py volume.surface.vdb; do
        mkdir $name
        expect 1 export model.vdb --out volume.vdb --fit 0 --level-set
        says err "$name"
        [[ ! -e volume.vdb ]] || fail "a volume was written although $name could not be"
        rmdir $name
        tried=$((tried + 1))
    done
    with_fake_colmap
    (cd data/train && ls) >fake/registered.0
    printf 'a file\n' >place
    expect 1 prepare data/train --out place
    says err "place"
    [[ "$(cat place)" == "a file" ]] || fail "prepare changed a file"
    expect 1 prepare data/train --out /proc/place
    says err "/proc/place"
    on_small_disk 0 silently 1 prepare data/train --out prepared
    [[ ! -e prepared/sparse/0/images.bin ]] || fail "prepare made a data set on a full disk"
    expect 0 prepare data/train --out prepared
    [[ -s prepared/sparse/0/images.bin ]] || fail "prepare could not go on"
    survived $((tried + 3)) "places that cannot be written"
}

test_max_memory() {
    local limit peak last=0
    if grep -qE '__(asan|tsan)_init' "$program"; then
        printf '%s\n' "a sanitizer has memory of its own: skipped"
        exit 77
    fi
    expect 0 synth thin --out data --views 12 --val-views 0 --test-views 0 --width 150 --height 150 --no-truth
    expect 0 train data --out model.vdb --steps 40,40,40,40 --json free.json
    peak=$(number free.json peak_memory_bytes)
    expect 2 train data --out tight.vdb --steps 40,40,40,40 --max-memory 140MiB
    says err "--max-memory: found 140 MiB, expected at least"
    [[ ! -e tight.vdb ]] || fail "a model in no memory"
    expect 2 train data --out model.vdb --resume --max-memory 260MiB
    says err "--max-memory: found 260 MiB, expected at least"
    says err "the voxels of model.ckpt; allow more, or train without --resume"
    for limit in 190 225 260; do
        ((peak > limit << 20)) || fail "$limit MiB are enough without a limit: $peak"
        expect 0 train data --out tight.vdb --steps 40,40,40,40 --max-memory ${limit}MiB --json tight.json
        says tight.json "stayed at voxels of"
        says err "finer ones need"
        (($(number tight.json peak_memory_bytes) <= (limit << 20) * 11 / 10)) ||
            fail "allowed $limit MiB, took $(number tight.json peak_memory_bytes) bytes"
        (($(number tight.json active_voxels) >= last)) || fail "fewer voxels in more memory"
        last=$(number tight.json active_voxels)
    done
    survived 5 "limits on memory: kept within a tenth (3), or refused (2)"
}

"test_$case_name"
