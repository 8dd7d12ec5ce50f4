#!/usr/bin/env bash
# Puts known faults back into the shaders, one at a time, and demands that the tests notice each. Works on a copy below
# the cache folder; needs the shader compiler (tools/setup.sh shaders).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source tools/env.sh
copy=$cache/mutant
log=$cache/mutant.log

# name | shader | sed expression | tests that must notice. The rows are those of the project's catalogue of failures.
mutants='
row 1, determinant as a c - b^2|include/conic.glsl|s/precise float det = .*/precise float det = (a + blur_m) * (c + blur_m) * m * m - b * b * m * m;/;s/^ *+ blur \* blur_m;$//|extreme::
row 2, exponent as a quadratic form|include/splat.glsl|s/precise float power = u \* u + w \* w;/precise float power = (m.x*m.x+m.z*m.z)*d.x*d.x + 2.0*(m.x*m.y+m.z*m.w)*d.x*d.y + (m.y*m.y+m.w*m.w)*d.y*d.y;/|extreme::
row 9, quaternions normalised without scaling|include/rotation.glsl|s/const vec4 scaled = q \/ largest;/const vec4 scaled = q;/|extreme::
row 10, forward and backward see other predicates|blend/blend_bwd.comp|s/raw >= view.alpha_min/raw >= 1.05 * view.alpha_min/|grad::
row 22, count and emit disagree|tiles/emit.comp|s/row < rows.y; ++row/row + 1u < rows.y; ++row/|kernel::
row 27, a clamped alpha has a derivative|blend/blend_bwd.comp|s/added \&\& raw < view.alpha_max ?/added ?/|grad::
row 36, the gradient of tau instead of log tau|project/project_bwd.comp|s/2.0 \* u \* u \* d_exponent/2.0 * u * u * rate * d_exponent/|grad::
cull without its reach|cull/bound.comp|s/float reach = s \*/float reach = 0.5 * s */|kernel::
sort that is not stable|sort/sort_scatter.comp|s/peers.x \& below.x/peers.x \& ~below.x/|kernel::
row 42, the end-point error of no error is divided by|loss/prior_loss.comp|s/distance > 0.0 ? pc.flow_weight \* (flow_error \/ distance) : vec2(0.0)/pc.flow_weight * (flow_error \/ distance)/|kernel::priors
row 45, LPIPS without its guard at zero features|lpips/lpips_tap.comp|s/team_sum(x_square) + EPS/team_sum(x_square)/|kernel::lpips::n22
row 53, the luma past the end has a derivative|include/bilateral.glsl|s/return luma > 0.0 \&\& luma < 1.0;/return luma > -1e30;/|kernel::bilateral
grids without their gauge|bilateral/bilateral_gauge.comp|s/-= mean;/-= 0.0 * mean;/|kernel::bilateral
offsets without their gauge|clock/clock_step.comp|s/clocks\[k\].x -= mean;/clocks[k].x -= 0.0 * mean;/|kernel::clock
alpha_min as a strict bound|blend/blend_fwd.comp|s/raw >= threshold\[k\]/raw > threshold[k] * 1.0001/|extreme::
'

tools/setup.sh test shaders
passed=0
failed=0
while IFS='|' read -r name file expression tests; do
    [ -n "$name" ] || continue
    rm -rf "$copy" && mkdir -p "$copy"
    git ls-files -z | xargs -0 cp --parents -t "$copy"
    # The tests that need the data beside the project find it from the copy too.
    ln -sfn "$PWD/../shared" "$cache/shared"
    (cd "$copy" && own_the_target_folder)
    sed -i "$expression" "$copy/shaders-glsl/$file"
    if cmp -s "shaders-glsl/$file" "$copy/shaders-glsl/$file"; then
        printf 'FAILED: %s: the expression changes nothing\n' "$name"
        failed=$((failed + 1))
    elif ! (cd "$copy" && IVV_BLESS=1 cargo build --locked --features shaders) >"$log" 2>&1 ||
        ! (cd "$copy" && cargo test --locked --features shaders --no-run) >>"$log" 2>&1; then
        printf 'FAILED: %s: the mutant does not build, see %s\n' "$name" "$log"
        failed=$((failed + 1))
    elif (cd "$copy" && cargo test --locked --features shaders --test it "$tests") >"$log" 2>&1; then
        printf 'FAILED: %s: %s notices nothing\n' "$name" "$tests"
        failed=$((failed + 1))
    else
        printf 'noticed: %s, by %s tests\n' "$name" "$(grep -c '^test .* FAILED' "$log")"
        passed=$((passed + 1))
    fi
done <<<"$mutants"
rm -rf "$copy" "$cache/shared"
own_the_target_folder
printf 'mutants: %d passed, %d failed\n' $passed $failed
[ $failed -eq 0 ]
