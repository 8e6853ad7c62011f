#!/bin/sh
# Makes the fits, figures and pictures of docs/examples again, in about eight minutes on two cores:
#
#     sh docs/examples/make.sh [NAME ...]      (ramachandran, wildfires, image-patches, poles)
#
# Needs orbiflow on the path, and chromium for pictures of the surfaces (left out without it).
# WORK: folder for fits and tables (out/examples).
# FIRES: table of wildfires, with FIRES_COLUMNS its latitude and longitude (1,2); left out without it.
# TOP8000: folder of rota8000-*.csv, whose rows that backbone.csv left out are scored; not done without it.
# COASTLINES: GeoJSON to draw over the maps of wildfires; maps have none without it.
set -eu
cd "$(dirname "$0")/../.."
work=${WORK:-out/examples}
data=examples/density
pictures=docs/images
mkdir -p "$work" "$pictures"

# shrink FROM TO: at most 860 pixels wide
shrink() {
    python -c '
import sys
from PIL import Image
image = Image.open(sys.argv[1]).convert("RGB")
width = min(860, image.width)
image = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
image.save(sys.argv[2], quality=84, method=6)
' "$1" "$2"
}

# surface NAME: a picture of the page that turns
surface() {
    if ! command -v chromium >/dev/null; then
        echo "no chromium: $pictures/$1-surface.webp is left as it is"
        return
    fi
    folder=$(cd "$work" && pwd)
    chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader \
        --enable-unsafe-swiftshader --hide-scrollbars --window-size=1100,860 \
        --virtual-time-budget=8000 --screenshot="$folder/$1-surface.png" \
        "file://$folder/$1/surface.html" >"$folder/$1-chromium.log" 2>&1
    shrink "$folder/$1-surface.png" "$pictures/$1-surface.webp"
}

# fit NAME TABLE COLUMNS OPTIONS...
fit() {
    name=$1 table=$2 columns=$3
    shift 3
    echo "== $name"
    orbiflow density fit "$table" --columns "$columns" --out "$work/$name" "$@"
}

# draw PICTURES OPTIONS...: of the last fit
draw() {
    wanted=$1
    shift
    orbiflow density plot --model "$work/$name" --data "$table" --columns "$columns" \
        --out "$work/$name" "$@"
    for picture in $wanted; do
        case $picture in
        surface) surface "$name" ;;
        *) shrink "$work/$name/$picture.png" "$pictures/$name-$picture.webp" ;;
        esac
    done
}

# region MASSES OPTIONS...: of the last fit
region() {
    masses=$1
    shift
    orbiflow density region --model "$work/$name" --mass "$masses" --out "$work/$name-regions.json" "$@"
}

# score OPTIONS...: log densities above uniform of the rows of standard input, in the table's own columns
score() {
    cat >"$work/$name-new.csv"
    orbiflow density score "$work/$name-new.csv" --model "$work/$name" --measure uniform \
        --out "$work/$name-scores.csv" "$@"
    cat "$work/$name-scores.csv"
}

# sample ROWS: of the last fit
sample() {
    orbiflow density sample --model "$work/$name" -n "$1" --out "$work/$name-drawn.csv"
}

ramachandran() {
    fit ramachandran "$data/backbone.csv" phi,psi --unit degrees
    draw "density samples" --regions 0.5,0.9,0.98,0.9995
    region 0.5,0.9,0.98,0.9995
    score --region --samples 200000 <<'TABLE'
phi,psi
-63,-43
-120,135
57,45
60,-120
100,-30
0,0
TABLE
    sample 100000
    python - "$table" "$work/$name-drawn.csv" <<'CODE'
import sys
import numpy as np

for file in sys.argv[1:]:
    phi, psi = np.loadtxt(file, delimiter=",", skiprows=1).T
    turn = lambda angle: (angle + 180) % 360 - 180
    for at in ((-63, -43), (57, 45)):
        near = np.hypot(turn(phi - at[0]), turn(psi - at[1])) < 20
        print(f"{file}: within 20 degrees of {at}: {near.mean():.2%}")
    strip = (turn(phi) > 90) & (turn(phi) < 170)
    print(f"{file}: phi from 90 to 170: {strip.mean():.3%}")
CODE
    if [ -z "${TOP8000:-}" ]; then
        echo "rows of the source that backbone.csv left out: not scored, TOP8000 is not set"
        return
    fi
    python - "$TOP8000" "$work/$name-others.csv" <<'CODE'
import sys
from pathlib import Path
import numpy as np

files = [Path(sys.argv[1]) / f"rota8000-{residue}.csv" for residue in ("his", "met", "trp")]
rows = [line.split(",")[1:3] for file in files for line in file.read_text().splitlines()]
kept = np.random.default_rng(0).choice(len(rows), 20_000, replace=False)  # as examples/density/make.py
others = np.delete(np.array(rows), kept, axis=0)
np.savetxt(sys.argv[2], others, "%s", delimiter=",", header="phi,psi", comments="")
CODE
    orbiflow density score "$work/$name-others.csv" --model "$work/$name" --measure uniform --region \
        --out "$work/$name-others-scores.csv"
    python - "$work/$name-others-scores.csv" "$work/$name-regions.json" <<'CODE'
import json
import sys
import numpy as np

scores = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1)[:, 2]
print(f"{len(scores)} rows: {scores.mean():.4f} nats above uniform")
for region in json.load(open(sys.argv[2]))["regions"]:
    level = region["log_prob"] + 2 * np.log(360)
    outside = np.mean(scores < level)
    print(f"mass {region['mass']}: {level:.2f} above uniform; {outside:.3%} of the other rows below")
CODE
}

sites() {
    score --region <<'TABLE'
lat,lon
6,-69
8,28
20,100
-28,-57
40,100
0,-150
TABLE
}

wildfires() {
    if [ -z "${FIRES:-}" ]; then
        echo "== wildfires: left out, FIRES is not set"
        return
    fi
    fit wildfires "$FIRES" "${FIRES_COLUMNS:-1,2}" --space sphere
    draw "density samples surface" ${COASTLINES:+--coastlines "$COASTLINES"}
    region 0.5,0.9
    sites
    sample 20000
    # here and for the cells below the first two columns are latitude and longitude
    python - "$FIRES" "$work/$name-drawn.csv" <<'CODE'
import sys
import numpy as np
from scipy.spatial import cKDTree

def vectors(file):
    rows = np.genfromtxt(file, delimiter=",", usecols=(0, 1), comments="#")
    lat, lon = np.radians(rows[np.isfinite(rows).all(1)]).T
    return np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], 1)

fires, drawn = map(vectors, sys.argv[1:])
tree = cKDTree(fires)
for what, chord in (("fires", tree.query(fires, 2)[0][:, 1]), ("samples", tree.query(drawn)[0])):
    far = 2 * np.degrees(np.arcsin(chord / 2))
    print(f"{what}: {np.mean(far > 2):.2%} more than 2 degrees from the next fire, {np.mean(far > 5):.2%} 5")
    print(f"{what}: half of them within {np.median(far):.4f} degrees")
sites = np.radians([[6, -69], [8, 28], [20, 100], [-28, -57], [40, 100], [0, -150]])
lat, lon = sites.T
at = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], 1)
cap = (1 - np.cos(np.radians(4))) / 2
for place, found in zip(np.degrees(sites), tree.query_ball_point(at, 2 * np.sin(np.radians(2)))):
    share = len(found) / len(fires) / cap
    print(place, f"counted {np.log(share):.2f}" if share else "counted none")
CODE
    fit wildfires-mixture "$FIRES" "${FIRES_COLUMNS:-1,2}" --space sphere --components mixture
    draw density --regions 0.5,0.9 ${COASTLINES:+--coastlines "$COASTLINES"}
    region 0.5,0.9
    sites
    awk -F, 'BEGIN { print "lat,lon,cell" }
        $1 ~ /^-?[0-9]/ { printf "%s,%s,%d_%d\n", $1, $2, ($1 + 90) / 2, ($2 + 180) / 2 }' \
        "$FIRES" >"$work/wildfires-cells.csv"
    orbiflow density cv "$work/wildfires-cells.csv" --columns lat,lon,cell=group --space sphere \
        --folds 5 --against mixture --against uniform --out "$work/wildfires-cv"
}

image_patches() {
    fit image-patches "$data/patches.csv" theta,phi --space klein-bottle --unit radians
    draw "density samples surface" --regions 0.5,0.9
    region 0.5,0.9
    score --region <<'TABLE'
theta,phi
0,0
1.5707963,0
0.7853982,0
0,1.5707963
0.7853982,1.5707963
TABLE
}

poles() {
    fit poles "$data/poles.csv" lat,lon --space projective-plane
    draw "density samples surface" --regions 0.5,0.9
    region 0.5,0.9
    score --region <<'TABLE'
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
    sample 20000
    python - "$table" "$work/$name-drawn.csv" <<'CODE'
import sys
import numpy as np

for file in sys.argv[1:]:
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    tilt, east = 90 - np.abs(rows[:, 0]), rows[:, 1] + 180 * (rows[:, 0] < 0)
    inside = ", ".join(f"{np.mean(tilt < far):.1%} within {far}" for far in (15, 30, 45, 60))
    print(f"{file}: {inside} degrees of the spin axis")
    turned = (east + 180) % 360 - 180
    for low, high in ((90, 135), (-45, 0)):
        wedge = (tilt > 30) & (turned > low) & (turned < high)
        print(f"{file}: {wedge.sum()} of {len(rows)} beyond 30 degrees between {low} and {high} east")
CODE
    orbiflow density cv "$table" --columns "$columns" --space projective-plane --folds 5 \
        --against kernels --against flow --out "$work/poles-cv"
    fit poles-gaussian "$table" lat,lon --space projective-plane --components angular-central-gaussian
    draw density --regions 0.5,0.9
    orbiflow density cv "$table" --columns "$columns" --space projective-plane --folds 5 \
        --components angular-central-gaussian --against default --against bingham --against watson \
        --out "$work/poles-gaussian-cv"
    awk -F, 'NR == 1 { print $0 ",polarity" }
        NR > 1 { if ($1 > 0) print $0 ",normal"; else print -$1 "," $2 - 180 ",reversed" }' \
        "$table" >"$work/poles-turned.csv"
    orbiflow density compare -d "$work/poles-turned.csv" --by polarity --space sphere --columns lat,lon
}

for example in ${*:-ramachandran wildfires image-patches poles}; do
    case $example in
    image-patches) image_patches ;;
    ramachandran | wildfires | poles) $example ;;
    *) echo "no example $example" >&2 && exit 2 ;;
    esac
done
