#!/usr/bin/env bash
# What the compilers of AMD's and NVIDIA's GPUs make of every kernel, without a GPU: a file of `ivv-gpu-model statistics --json` for
# each chip and width of subgroups, OUT/CHIP-LANES.json.
#   statistics.sh IVV-GPU-MODEL OUT
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
model=$(realpath "$1")
mkdir -p "$2" && out=$(realpath "$2")
rm -f "$out"/*.json
drivers=$("$here/drivers.sh")
export MESA_SHADER_CACHE_DISABLE=1
# A driver that fails on a chip leaves it out; the comparison then says nothing of it.
left_out() {
    echo "statistics.sh: left out: $1, whose driver failed" >&2
    rm -f "$out/$1.json"
}
# RDNA2, RDNA3, RDNA4, GCN5, CDNA2, by RADV without a device.
for chip in navi21-32 navi21-64 navi31-32 navi31-64 gfx1200-32 gfx1200-64 vega10-64 mi200-64; do
    VK_DRIVER_FILES=$drivers/radeon.json VK_ICD_FILENAMES=$drivers/radeon.json RADV_FORCE_FAMILY=${chip%-*} \
        LD_LIBRARY_PATH=$drivers/backports/root/usr/lib/x86_64-linux-gnu \
        "$model" statistics --subgroup-size "${chip#*-}" --json >"$out/$chip.json" || left_out "$chip"
done
# NVK's compiler is not NVIDIA's. It knows Turing and Ampere, of which GA100 is nearest to Hopper.
lib=$drivers/trixie/root/usr/lib/x86_64-linux-gnu
for chip in 162:TU102 170:GA100 172:GA102; do
    VK_DRIVER_FILES=$drivers/nouveau.json VK_ICD_FILENAMES=$drivers/nouveau.json NVK_I_WANT_A_BROKEN_VULKAN_DRIVER=1 \
        NOUVEAU_CHIPSET=${chip%:*} "$lib/ld-linux-x86-64.so.2" --library-path "$lib" \
        --preload "$lib/libnouveau_noop_drm_shim.so" \
        "$model" statistics --chip "${chip#*:}" --json >"$out/${chip#*:}-32.json" 2> >(grep -v DRM_IOCTL >&2) || left_out "${chip#*:}-32"
done
