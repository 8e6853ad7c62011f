#!/bin/sh
# Makes the fits, figures and pictures of docs/examples again:
#
#     sh docs/examples/make.sh [NAME ...]      (ramachandran, wildfires, image-patches, poles)
#
# Needs orbiflow on the path, and chromium for pictures of the surfaces (left out without it).
# WORK: folder for fits and tables (out/examples). LIMIT: seconds of refinement of each fit (60).
# FIRES: table of wildfires, with FIRES_COLUMNS its latitude and longitude (1,2); left out without it.
set -eu
cd "$(dirname "$0")/../.."
work=${WORK:-out/examples}
limit=${LIMIT:-60}
data=examples/density
pictures=docs/images
mkdir -p "$work" "$pictures"

# shrink FROM TO: at most 760 pixels wide
shrink() {
    python -c '
import sys
from PIL import Image
image = Image.open(sys.argv[1]).convert("RGB")
width = min(760, image.width)
image = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
image.save(sys.argv[2], optimize=True)
' "$1" "$2"
}

# surface NAME: a picture of the page that turns
surface() {
    if ! command -v chromium >/dev/null; then
        echo "no chromium: $pictures/$1-surface.png is left as it is"
        return
    fi
    page=$(cd "$work/$1" && pwd)
    chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader \
        --enable-unsafe-swiftshader --hide-scrollbars --window-size=1100,860 \
        --virtual-time-budget=8000 --screenshot="$page/surface.png" \
        "file://$page/surface.html" >"$page/chromium.log" 2>&1
    shrink "$page/surface.png" "$pictures/$1-surface.png"
}

# example NAME PICTURES TABLE COLUMNS FIT-OPTIONS...
example() {
    name=$1 wanted=$2 table=$3 columns=$4
    shift 4
    echo "== $name"
    orbiflow density fit "$table" --columns "$columns" --seconds "$limit" --out "$work/$name" "$@"
    # dots would hide the colours of the square
    case $wanted in *density*) dots= ;; *) dots=--dots ;; esac
    orbiflow density plot --model "$work/$name" --data "$table" --columns "$columns" \
        --out "$work/$name" $dots
    for picture in $wanted; do
        case $picture in
        surface) surface "$name" ;;
        *) shrink "$work/$name/$picture.png" "$pictures/$name-$picture.png" ;;
        esac
    done
}

# score NAME: log densities of the rows of standard input, in the table's own columns
score() {
    cat >"$work/$1-new.csv"
    orbiflow density score "$work/$1-new.csv" --model "$work/$1" --measure uniform \
        --out "$work/$1-scores.csv"
    cat "$work/$1-scores.csv"
}

ramachandran() {
    example ramachandran "density samples" "$data/backbone.csv" phi,psi --space torus --unit degrees
    score ramachandran <<'TABLE'
phi,psi
-63,-43
-120,135
57,45
60,-120
0,0
TABLE
    # levels that 98 % and 99.95 % of residues are above
    orbiflow density score "$data/backbone.csv" --model "$work/ramachandran" --measure uniform \
        --out "$work/backbone-scores.csv"
    python -c '
import sys
import numpy as np
scores = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1)[:, 2]
print("favoured above %.2f, allowed above %.2f" % tuple(np.quantile(scores, [0.02, 0.0005])))
' "$work/backbone-scores.csv"
}

wildfires() {
    if [ -z "${FIRES:-}" ]; then
        echo "== wildfires: left out, FIRES is not set"
        return
    fi
    example wildfires "samples surface" "$FIRES" "${FIRES_COLUMNS:-1,2}" --space sphere --kernels
    score wildfires <<'TABLE'
lat,lon
6,-69
8,28
-28,-57
20,100
40,100
0,-150
TABLE
}

image_patches() {
    example image-patches "density samples surface" "$data/patches.csv" theta,phi --space klein-bottle
    score image-patches <<'TABLE'
theta,phi
0,0
1.5707963,0
0.7853982,0
0,1.5707963
0.7853982,1.5707963
TABLE
}

poles() {
    example poles "samples surface" "$data/poles.csv" lat,lon --space projective-plane
    score poles <<'TABLE'
lat,lon
90,0
-90,0
60,0
60,90
60,180
60,-90
0,0
0,90
TABLE
}

for example in ${*:-ramachandran wildfires image-patches poles}; do
    case $example in
    image-patches) image_patches ;;
    ramachandran | wildfires | poles) $example ;;
    *) echo "no example $example" >&2 && exit 2 ;;
    esac
done
