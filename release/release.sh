#!/usr/bin/env bash
# Builds the sdist and the wheel of a release into dist/, checks them, and installs the wheel in an
# empty environment. It publishes nothing. The packages for it come from the index of pip.
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -n "$(git status --porcelain)" ]; then
  echo "the checkout has changes: commit them first" >&2
  exit 2
fi
version=$(sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
grep -q "^## .*$version" CHANGELOG.md || { echo "CHANGELOG.md has no heading for $version" >&2; exit 2; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
sed -E -e '/^ *--hash/d' -e 's/ \\$//' requirements.lock >"$work/constraints.txt"

"${PYTHON:-python3}" -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check \
  build hatchling twine check-wheel-contents
rm -f dist/scaraspec-*
"$work/tools/bin/python" -m build --no-isolation # the wheel is built from the sdist
"$work/tools/bin/twine" check --strict dist/*.tar.gz dist/*.whl
"$work/tools/bin/check-wheel-contents" dist/*.whl

"${PYTHON:-python3}" -m venv "$work/empty"
"$work/empty/bin/pip" install --quiet --disable-pip-version-check \
  -c "$work/constraints.txt" dist/*.whl
cd "$work"
shown=$(empty/bin/scaraspec --version)
echo "$shown"
[[ $shown == *"version $version (commit "* ]]
empty/bin/scaraspec controller --listen 127.0.0.1:0 --ready-file ready >/dev/null &
controller=$!
trap 'kill $controller; rm -rf "$work"' EXIT
for _ in $(seq 100); do [ -s ready ] && break; sleep 0.1; done
empty/bin/scaraspec certify controller "tcp://$(cat ready)" --only 4.8 --state-dir state --out run
empty/bin/scaraspec audit run/capture.mcap
empty/bin/scaraspec gate run --baseline baseline.json --update
echo "dist/ contains scaraspec $version; publish it with: twine upload dist/*"
