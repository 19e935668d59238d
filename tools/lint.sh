#!/usr/bin/env bash
# Layout of C++ and CUDA (clang-format), lint and layout (ruff) and types (mypy) of Python, and the vocabulary of
# comments and pages (tools/vocabulary.py). Runs all of them; the exit code is 1 if any reports something.
set -euo pipefail
. "$(dirname "$0")/step.sh"

bin=.venv/bin
if ! cmp -s tools/packages/lint_requirements.txt .venv/clearance-lint; then
  step lint-setup "Install the linters into .venv" \
    "$bin/python" -m pip install --disable-pip-version-check --progress-bar off -r tools/packages/lint_requirements.txt
  cp tools/packages/lint_requirements.txt .venv/clearance-lint
fi

# All run at once, and report in order.
names=() jobs=()
run() {
  names+=("$1")
  "${@:2}" >"$log_dir/lint ${1}.log" 2>&1 &
  jobs+=($!)
}
mapfile -t sources < <(git ls-files '*.cpp' '*.h' '*.cu' '*.cuh')
run clang-format "$bin/clang-format" --dry-run -Werror --ferror-limit=1 "${sources[@]}"
run "ruff check" "$bin/ruff" check
run "ruff format" "$bin/ruff" format --check
run mypy "$bin/mypy" --python-executable "$bin/python"
run vocabulary "$bin/python" tools/vocabulary.py
failed=()
for i in "${!jobs[@]}"; do
  wait "${jobs[i]}" || failed+=("${names[i]}")
  say "${names[i]}"
  cat "$log_dir/lint ${names[i]}.log"
done
((${#failed[@]} == 0)) || die "found by ${failed[*]}. clang-format -i and ruff format write the layout; both are in $bin"
