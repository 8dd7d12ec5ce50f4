# Sourced by the scripts, in the checkout's root: where tools and build output are.
#
# Build output goes to a folder that all checkouts of this machine share, so that shaderc is compiled once. Cargo tells two
# checkouts of one package apart by file times alone and would take the older one's artifacts for fresh: this package's own
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
        cargo clean --quiet --package ivv
        cargo clean --quiet --package ivv --release
    fi
    mkdir -p "$CARGO_TARGET_DIR" && printf '%s' "$PWD" >"$stamp"
}
