#!/usr/bin/env bash
# The manual.
#   tools/manual.sh               builds the book into out/manual; needs mdBook, see `tools/setup.sh manual`
#   tools/manual.sh run IVV [DIR] runs every `sh` block of the README and of the book's pages with the program IVV, in DIR or
#                                 in a new folder. `tools/test.sh --manual` does this.
#
# All blocks run in one folder, page after page in the order of the book, so that a page may use what an earlier one made.
# A comment on the line before a block, which no reader sees, says how it runs:
#   <!-- before: COMMAND -->      COMMAND makes what the block takes for granted
#   <!-- until interrupted -->    the block runs until Ctrl-C, which it is given after a few seconds
#   <!-- not run: REASON -->      what the block needs is not there
#   <!-- file: NAME -->           the block, in whatever language, is the file NAME
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/ivv

build() {
    local said
    export PATH=$cache/manual/bin:$PATH
    if ! said=$(mdbook build "$root/assets/manual" 2>&1); then
        printf '%s\n' "$said" >&2
        exit 1
    fi
    printf '%s\n' "$said"
    # mdBook goes on after a page that it cannot include or a link in the summary that leads nowhere.
    if grep -Eq 'WARN|ERROR' <<<"$said"; then
        echo "manual: mdBook warns, see above" >&2
        exit 1
    fi
    echo "manual: $root/out/manual/index.html"
}

# The README, and the book's pages in its order.
pages() {
    echo "$root/README.md"
    sed -n "s|.*](\(.*\.md\)).*|$root/assets/manual/src/\1|p" "$root/assets/manual/src/SUMMARY.md"
}

# split PAGE DIR: writes each block to DIR/NUMBER.sh or .file, what its comment says to DIR/NUMBER.how, its line to
# DIR/NUMBER.line.
split() {
    awk -v dir="$2" '
        # A block or a comment of a list is indented by three.
        (!inside && /^   (```|<!--)/) || (inside && listed) { listed = 1; sub(/^   /, "") }
        /^```/ && !inside {
            inside = 1; kept = ($0 == "```sh" || how ~ /^file: /)
            if (kept) {
                name = sprintf("%s/%03d", dir, ++n)
                body = name ".body"
                printf "" > body
                print how > (name ".how")
                print FNR > (name ".line")
            }
            next
        }
        /^```$/ && inside { inside = 0; listed = 0; if (kept) close(body); how = ""; next }
        inside { if (kept) print > body; next }
        /^<!-- (before|until interrupted|not run|file)/ { how = $0; sub(/^<!-- /, "", how); sub(/ -->$/, "", how); next }
        /./ { how = "" }
    ' "$1"
}

# block NUMBER: runs one block as its comment says.
block() {
    local how
    how=$(cat "$1.how")
    case $how in
    "before: "*)
        bash -euo pipefail -c "${how#before: }" && bash -euo pipefail "$1.body"
        ;;
    "until interrupted"*)
        local code=0
        timeout --signal=INT 8 bash -euo pipefail -c 'eval "exec $(cat "$1")"' - "$1.body" || code=$?
        # timeout's own code, or that of a program that ends cleanly.
        [ $code = 124 ] || [ $code = 130 ] || [ $code = 0 ]
        ;;
    *) bash -euo pipefail "$1.body" ;;
    esac
}

run() {
    local ivv=$1 folder=${2:-} blocks n_run=0 n_skipped=0 page number how start
    folder=${folder:-$(mktemp -d)}
    mkdir -p "$folder"
    if [ -n "$(ls -A "$folder")" ]; then
        echo "manual: $folder is not empty; name an empty folder or a new one" >&2
        exit 2
    fi
    blocks=$(mktemp -d)
    trap 'rm -rf "'"$blocks"'"' EXIT
    mkdir -p "$blocks/bin"
    ln -sf "$(realpath "$ivv")" "$blocks/bin/ivv"
    export PATH=$blocks/bin:$PATH
    cd "$folder"
    # Pages name shipped files as they lie in the repository.
    ln -s "$root/assets" "$root/tools" .
    while IFS= read -r page; do
        rm -f "$blocks"/*.body "$blocks"/*.how "$blocks"/*.line
        split "$page" "$blocks"
        for number in "$blocks"/*.body; do
            [ -e "$number" ] || continue
            number=${number%.body}
            how=$(cat "$number.how")
            case $how in
            "not run: "*)
                n_skipped=$((n_skipped + 1))
                printf 'manual: %s:%s: not run, %s\n' "${page#"$root"/}" "$(cat "$number.line")" "${how#not run: }"
                continue
                ;;
            "file: "*)
                mkdir -p "$(dirname "${how#file: }")"
                cp "$number.body" "${how#file: }"
                continue
                ;;
            esac
            start=$SECONDS
            if ! block "$number" >"$number.log" 2>&1; then
                printf 'manual: FAILED %s:%s, in %s:\n' "${page#"$root"/}" "$(cat "$number.line")" "$folder" >&2
                cat "$number.body" >&2
                echo "manual: it said:" >&2
                tail -n 30 "$number.log" >&2
                exit 1
            fi
            n_run=$((n_run + 1))
            printf 'manual: %s:%s: %d s\n' "${page#"$root"/}" "$(cat "$number.line")" $((SECONDS - start))
        done
    done < <(pages)
    if [ $n_run -lt 20 ]; then
        echo "manual: only $n_run blocks were found" >&2
        exit 1
    fi
    printf 'manual: %d blocks ran, %d did not\n' $n_run $n_skipped
    [ $# -gt 1 ] || rm -rf "$folder"
}

case ${1:-build} in
build) build ;;
run)
    [ $# -ge 2 ] || { echo "usage: tools/manual.sh run IVV [DIR]" >&2; exit 2; }
    shift
    run "$@"
    ;;
*)
    echo "usage: tools/manual.sh [run IVV [DIR]]" >&2
    exit 2
    ;;
esac
