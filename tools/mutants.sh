#!/usr/bin/env bash
# Puts known faults back, one at a time, and demands that a row of `ivv-conformance` turns red, or that a test does where no row
# can. A fault in a shader is compiled into a folder, out of which the tests, built once, take their kernels: seconds a fault. One in
# the engine rebuilds it, in a copy below the cache folder. Needs the shader compiler (tools/setup.sh shaders).
#   tools/mutants.sh [WORD...]     all, or those of which the name or the row holds one of the words
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
copy=$cache/mutant
spirv=$cache/mutant-spirv
log=$cache/mutant.log

# name | file | sed expression | row or tests that must notice. "Row" in a name is one of `ivv-conformance`.
mutants='
a record that is not finite is drawn|shaders-glsl/project/project.comp|s/if (!bad \&\& splat.z > view.near/if (splat.z > view.near/|n01
row 8, covariance without its scaling|shaders-glsl/include/conic.glsl|s/const float m = max(.*1e-18);/const float m = 1.0;/|n02
row 1, determinant as a c - b^2|shaders-glsl/include/conic.glsl|s/precise float det = .*/precise float det = (a + blur_m) * (c + blur_m) * m * m - b * b * m * m;/;s/^ *+ blur \* blur_m;$//|n03
row 2, exponent as a quadratic form|shaders-glsl/include/splat.glsl|s/precise float power = u \* u + w \* w;/precise float power = (m.x*m.x+m.z*m.z)*d.x*d.x + 2.0*(m.x*m.y+m.z*m.w)*d.x*d.y + (m.y*m.y+m.w*m.w)*d.y*d.y;/|n03
row 9, quaternions normalised without scaling|shaders-glsl/include/rotation.glsl|s/const vec4 scaled = q \* factor;/const vec4 scaled = q;/|n04
the near plane a hundredth further|shaders-glsl/cull/cull.comp|s/p.z > view.near/p.z > 1.01 * view.near/|n05
cull without its reach|shaders-glsl/cull/bound.comp|s/float reach = s \*/float reach = 0.5 * s */|n06
row 22, count and emit disagree|shaders-glsl/tiles/emit.comp|s/if (item < all_rows) columns/if (item + 1u < all_rows) columns/|n06
row 10, forward and backward see other predicates|shaders-glsl/blend/blend_bwd.comp|s/raw >= view.alpha_min/raw >= 1.05 * view.alpha_min/|n07
row 27, a clamped alpha has a derivative|shaders-glsl/blend/blend_bwd.comp|s/added \&\& raw < view.alpha_max ?/added ?/|n07
alpha_min as a strict bound|shaders-glsl/blend/blend_fwd.comp|s/raw >= threshold\[k\]/raw > threshold[k] * 1.0001/|n07
row 28, the transmittance is not found again|shaders-glsl/blend/blend_bwd.comp|s/const float T_i = T\[k\] \* ra;/const float T_i = T[k];/|n08
the gradient of an opacity of 0 is no number|shaders-glsl/blend/blend_bwd.comp|s/max(opacity, 1e-37)/opacity/|the_exact_preset_gives
the second round of blending begins anew|shaders-glsl/blend/blend_fwd.comp|s/if (inside \&\& round > 0u)/if (inside \&\& round > 1u)/|n09
row 25, a sort that is not stable|shaders-glsl/sort/sort_scatter.comp|s/(lane ^ j) < lane/(lane ^ j) > lane/|n10
row 35, the window in time at half its length|shaders-glsl/cull/bound.comp|s/exp(t_scale) \* sqrt/0.5 * exp(t_scale) * sqrt/|n11
row 36, the gradient of tau instead of log tau|shaders-glsl/project/project_bwd.comp|s/2.0 \* u \* u \* d_exponent/2.0 * u * u * rate * d_exponent/|n11
row 37, 1 over tau overflows|shaders-glsl/include/temporal.glsl|s/exp(min(-t_scale, 80.0))/exp(-t_scale)/|n12
row 39, t_center without what rounding lost|shaders-glsl/include/adam.glsl|s/residual = lost;/residual = 0.0;/|n13
flow without the motion along the ray|shaders-glsl/project/project.comp|s/v_cam.xy - uv \* v_cam.z/v_cam.xy/|n14
row 48, a scene that stays far from zero|engine/stage/scene.rs|s/limit, far_origin(splats))/limit, [0.0; 3])/|n15
directions whose squares overflow|shaders-glsl/include/camera.glsl|s/const vec3 scaled = d \* factor;/const vec3 scaled = d;/|n16
fx taken for fy|shaders-glsl/project/project.comp|s/const vec3 a1 = f_z.y \*/const vec3 a1 = f_z.x */|n17
pictures cut to whole tiles|shaders-glsl/cull/cull.comp|s/vec2(float(view.width),/vec2(float(view.width \/ 16u * 16u),/|n18
colours below 0|shaders-glsl/project/project.comp|s/max(color, vec3(0.0))/color/|n19
row 42, the end-point error of no error is divided by|shaders-glsl/loss/prior_loss.comp|s/distance > 0.0 ? pc.flow_weight \* (flow_error \/ distance) : vec2(0.0)/pc.flow_weight * (flow_error \/ distance)/|n20
row 44, a variance below 0|shaders-glsl/loss/ssim.comp|s/precise vec3 d = max(variances, vec3(0.0))/precise vec3 d = variances/|n21
moments that are rounded to the nearest|shaders-glsl/include/moments.glsl|s/bits \& 0xffffu)/uvec4(0x8000u))/|n25
row 45, LPIPS without its guard at zero features|shaders-glsl/lpips/lpips_tap.comp|s/team_sum(x_square) + EPS/team_sum(x_square)/|n22
row 53, the luma past the end has a derivative|shaders-glsl/include/bilateral.glsl|s/return luma > 0.0 \&\& luma < 1.0;/return luma > -1e30;/|n23
a gradient that is not finite moves the moments|shaders-glsl/project/project_bwd.comp|s/^    if (!good) return;$//|n24
row 16, a sum of counts that wraps|shaders-glsl/scan/scan_downsweep.comp|s/> 0xffffu ? 0xffffffffu :/> 0xffffffu ? 0xffffffffu :/|n26
room for one intersection more than there is|shaders-glsl/scan/scan_downsweep.comp|s/const bool fits = n <= pc.capacity/const bool fits = n <= pc.capacity + 1u/|n26
row 40, offsets without their gauge|shaders-glsl/clock/clock_step.comp|s/clocks\[k\].x -= mean;/clocks[k].x -= 0.0 * mean;/|n27
row 7, gradients are not looked at|shaders-glsl/project/project_bwd.comp|s/const bool good = finite4.*/const bool good = true;/|n28
row 60, the gain at the source|engine/sound/geometry.rs|s/r_m \/ bearing.r_l.max(r_min)/r_m \/ bearing.r_l/|n29
sums of gradients without their carry|shaders-glsl/include/batch.glsl|s/a.y + b.y + uint(low < a.x)/a.y + b.y/|kernel::batch
gradients beyond 16 are no gradients|shaders-glsl/include/batch.glsl|s/clamp(g \* BATCH_SCALE, -BATCH_LARGEST, BATCH_LARGEST)/g * BATCH_SCALE/|n24
a correction of a pose that leaves the camera of the next frame|shaders-glsl/project/project_bwd.comp|s/== CAMERA_WITH_NEXT/== 7u/|a_flow_that_no_pose_changes
photographs that speak of motion|shaders-glsl/fisher/fisher.comp|s/pc.is_of_clip \* //|kernel::fisher
sums of fixed point that wrap without a word|shaders-glsl/include/fixed.glsl|s/weight.x >= FIXED_MOST/false/|a_sum_beyond_the_fixed_point
photographs that the gauge counts|shaders-glsl/bilateral/bilateral_gauge.comp|s/k < n_filming/k < n_cameras/|the_gauge_takes
grids without their gauge|shaders-glsl/bilateral/bilateral_gauge.comp|s/-= mean;/-= 0.0 * mean;/|kernel::bilateral
'

# Whether name $1 and tests $2 were asked for by the words after them.
asked() {
    local about="$1 $2" word
    shift 2
    [ $# -gt 0 ] || return 0
    for word; do
        [[ $about != *"$word"* ]] || return 0
    done
    return 1
}

# shaders_with FILE: the shaders that FILE is, or is part of.
shaders_with() {
    local user
    case $1 in
    *.comp) echo "$1" ;;
    *) grep -rlF "#include \"${1##*/}\"" shaders-glsl --include='*.comp' --include='*.glsl' | while read -r user; do
        shaders_with "$user"
    done ;;
    esac
}

# compile FILE: the kernels that FILE is part of, out of $copy into $spirv.
compile() {
    local shader
    rm -rf "$spirv" && mkdir -p "$spirv"
    for shader in $(shaders_with "$1" | sort -u); do
        sed -n "s#^${shader#shaders-glsl/}: ##p" <<<"$kernels" | tr -d ' ' | tr ',' '\n'
    done | CARGO_MANIFEST_DIR=$copy xargs -P "$(nproc)" -I{} \
        env IVV_KERNEL={} IVV_SPIRV="$spirv/{}.spv" "$compiler" >"$log" 2>&1
}

# tests_of ROW_OR_TESTS
tests_of() {
    case $1 in
    n[0-9][0-9]) echo "extreme::$1" ;;
    *) echo "$1" ;;
    esac
}

# Runs the row or the tests $1 on the mutant of file $2: 0 where they notice, 1 where they do not, 2 where they cannot be run.
noticed() {
    local status=0
    case $2 in
    shaders-glsl/*)
        IVV_TEST_REWRITE=replaced IVV_TEST_KERNELS=$spirv cargo test --locked --features shaders --test it "$(tests_of "$1")" \
            >"$log" 2>&1 || status=$?
        ;;
    *)
        (cd "$copy" && own_the_target_folder && cargo test --locked --features shaders --test it --no-run) >"$log" 2>&1 || return 2
        (cd "$copy" && cargo test --locked --features shaders --test it "$(tests_of "$1")") >"$log" 2>&1 || status=$?
        own_the_target_folder
        ;;
    esac
    # cargo's status where tests failed.
    [ $status -ne 101 ] || return 0
    [ $status -eq 0 ] && return 1
    return 2
}

# The engine's mutants last: each rebuilds all.
ordered=$(grep '|shaders-glsl/' <<<"$mutants"; grep -v '|shaders-glsl/' <<<"$mutants")
tools/setup.sh test shaders
own_the_target_folder
cargo test --locked --features shaders --no-run
kernels=$(cargo run --locked --quiet --features shaders --bin ivv -- profile --list)
# The build script of the newest build is the compiler: see build.rs.
compiler=$(find "$CARGO_TARGET_DIR/debug/build" -path '*/ivv-*/output' -printf '%T@ %p\n' | sort -rn | cut -d ' ' -f 2- |
    xargs sed -n 's/^cargo::rustc-env=IVV_SHADER_COMPILER=//p' | head -n 1)
passed=0
failed=0
skipped=0
while IFS='|' read -r name file expression tests; do
    [ -n "$name" ] || continue
    if ! asked "$name" "$tests" "$@"; then
        skipped=$((skipped + 1))
        continue
    fi
    rm -rf "$copy" && mkdir -p "$copy"
    git ls-files -z | xargs -0 cp --parents -t "$copy"
    # The tests that need the data beside the project find it from the copy too.
    ln -sfn "$PWD/../shared" "$cache/shared"
    result=0
    if [ $((passed + failed)) -eq 0 ] && { ! compile shaders-glsl/include/finite.glsl || noticed "$tests" "shaders-glsl/"; }; then
        printf 'FAILED: %s is red without a fault, or the shaders do not compile, see %s\n' "$tests" "$log"
        exit 1
    fi
    sed -i "$expression" "$copy/$file"
    if cmp -s "$file" "$copy/$file"; then
        printf 'FAILED: %s: the expression changes nothing\n' "$name"
    elif [[ $file == shaders-glsl/* ]] && ! compile "$file"; then
        printf 'FAILED: %s: the mutant does not compile, see %s\n' "$name" "$log"
    else
        noticed "$tests" "$file" || result=$?
        case $result in
        0)
            printf '%s is red: %s\n' "$tests" "$name"
            grep -A 3 '^---- ' "$log" | cut -c 1-150 | sed -n '3,4s/^/    /p'
            passed=$((passed + 1))
            continue
            ;;
        1) printf 'FAILED: %s stays green: %s\n' "$tests" "$name" ;;
        *) printf 'FAILED: %s cannot be run: %s, see %s\n' "$tests" "$name" "$log" ;;
        esac
    fi
    failed=$((failed + 1))
done <<<"$ordered"
rm -rf "$copy" "$spirv" "$cache/shared"
printf 'mutants: %d passed, %d failed, %d not asked for\n' $passed $failed $skipped
[ $failed -eq 0 ]
