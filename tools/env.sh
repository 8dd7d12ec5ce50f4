# Sourced by the scripts, in the checkout's root: where tools and build output are.
#
# Build output goes to a folder that all checkouts of this machine share, so that shaderc is compiled once. Cargo tells two
# checkouts of one package apart by file times alone and would take the older one's artifacts for fresh: the workspace's own
# are removed whenever another checkout built last.
export PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
cache=${XDG_CACHE_HOME:-$HOME/.cache}/ivv
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$cache/target}"
# What ivv tells of itself in train.json; empty outside of git.
IVV_REVISION=$(git describe --always --abbrev=12 --dirty 2>/dev/null || true)
export IVV_REVISION

own_the_target_folder() {
    local stamp=$CARGO_TARGET_DIR/checkout
    if [ -d "$CARGO_TARGET_DIR" ] && [ "$(cat "$stamp" 2>/dev/null)" != "$PWD" ]; then
        local own=(--package ivv --package ivv-play --package ivv-conformance --package ivv-gpu-model)
        cargo clean --quiet "${own[@]}"
        cargo clean --quiet "${own[@]}" --release
    fi
    mkdir -p "$CARGO_TARGET_DIR" && printf '%s' "$PWD" >"$stamp"
}

# Sets up and builds what runs, with options of cargo; $ivv is the program then.
build_ivv() {
    tools/setup.sh run
    own_the_target_folder
    cargo build --release --locked "$@"
    ivv=$CARGO_TARGET_DIR/release/ivv
}

# For scripts that measure. $data is where real captures and the weights of LPIPS are, if they are there. $lpips are the options
# of `ivv train` with which LPIPS is measured and no part of the loss; its weights are written into FOLDER.
#   find_data FOLDER
find_data() {
    data=$(realpath -m "${IVV_DATA:-../shared/data}")
    lpips=()
    if [ ! -d "$data/lpips" ]; then
        echo "left out: LPIPS; $data/lpips is not there"
        return
    fi
    python3 tools/lpips_weights.py "$data/lpips/squeeze.backbone.pth" "$data/lpips/lpips/weights/v0.1/squeeze.pth" \
        "$1/lpips.safetensors"
    lpips=(--set loss.lpips=0 --set "loss.lpips_weights=$1/lpips.safetensors")
}
