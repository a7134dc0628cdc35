#!/usr/bin/env bash
# Prepares this checkout; called by make, and does nothing when there is nothing to do.
#   tools/setup.sh packages EXTRAS   .venv with the project and its extras (view or view,dev)
#   tools/setup.sh opengl            an OpenGL context that needs no window
#   tools/setup.sh desk              a virtual screen, for tests of the window; without it they are
#                                    skipped, so this never fails
# Every failure is one line that says what to install; exit status 3, as for a machine that lacks
# something. PYTHON names the interpreter to use.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv=.venv
mesa="libegl1 libgl1 libgl1-mesa-dri"
desk="xvfb openbox xdotool"

say() { printf 'setup: %s\n' "$*" >&2; }
stop() { say "$*"; exit 3; }

# First Python of 3.11 or later on the path.
find_python() {
  local name
  for name in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
    if "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$name"
      return
    fi
  done
  stop "Python 3.11 or later is needed (Debian, Ubuntu: apt-get install python3 python3-venv), or name one: make PYTHON=/path/to/python3"
}

# What an installation depends on: declared packages, place of the checkout, interpreter.
fingerprint() {
  printf '%s %s\n' "$(pwd -P)" "$("$venv/bin/python" -V 2>&1)"
  cat pyproject.toml
}

is_installed() {
  [ -f "$venv/installed-$1" ] && fingerprint 2>/dev/null | cmp -s - "$venv/installed-$1"
}

make_venv() {
  local python
  python=$(find_python)
  say "making $venv with $("$python" -V)"
  "$python" -m venv --clear "$venv" >/dev/null 2>&1 ||
    stop "$python cannot make a virtual environment here (Debian, Ubuntu: apt-get install python3-venv)"
}

# Show on one line of a terminal what pip is busy with; elsewhere stay silent.
show_progress() {
  local line
  while IFS= read -r line; do
    if [ -t 2 ]; then printf '\r\033[K  %.70s' "$line" >&2; fi
  done
  if [ -t 2 ]; then printf '\r\033[K' >&2; fi
}

install_packages() {
  local extras=$1 started=$SECONDS log=$venv/setup.log
  # What holds all extras serves those who ask for fewer.
  if is_installed "view,dev" || is_installed "$extras"; then return; fi
  "$venv/bin/python" -m pip --version >/dev/null 2>&1 || make_venv
  rm -f "$venv"/installed-*
  say "installing packages into $venv (the first time a few hundred megabytes are fetched)"
  # A user's pip settings hold, but for those that would install somewhere else.
  if ! env -u PIP_USER -u PIP_TARGET -u PIP_PREFIX -u PIP_ROOT -u PIP_QUIET \
    "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --progress-bar off \
    --editable ".[$extras]" 2>&1 </dev/null | tee "$log" | show_progress; then
    tail -n 15 "$log" >&2
    stop "pip could not install the packages; its last lines are above, all of them in $log"
  fi
  fingerprint >"$venv/installed-$extras"
  say "packages ready after $((SECONDS - started)) s"
}

has_context() {
  "$venv/bin/python" -c 'from runtime.capture import make_context; make_context().release()' \
    >"$venv/opengl.log" 2>&1
}

# apt-get as root, directly or through a sudo that asks nothing.
as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

# apt_install REASON PACKAGE...
apt_install() {
  command -v apt-get >/dev/null && as_root true 2>/dev/null || return 1
  say "$1: installing ${*:2} through apt-get"
  { as_root apt-get update -qq && as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${@:2}"; } </dev/null >"$venv/apt.log" 2>&1
}

ensure_opengl() {
  local stamp=$venv/opengl
  if [ -f "$stamp" ]; then return; fi
  if ! has_context; then
    # shellcheck disable=SC2086
    apt_install "no OpenGL context can be made" $mesa || true
    has_context || stop "no OpenGL context can be made: install Mesa (Debian, Ubuntu: sudo apt-get install $mesa) and run make again; details in $venv/opengl.log"
  fi
  rm -f "$venv/opengl.log" "$venv/apt.log"
  touch "$stamp"
}

has_desk() {
  command -v Xvfb && command -v openbox && command -v xdotool
} >/dev/null

# Tried once: who installs it later needs no set-up for it.
ensure_desk() {
  local stamp=$venv/desk
  if [ -f "$stamp" ]; then return; fi
  if ! has_desk; then
    # shellcheck disable=SC2086
    apt_install "there is no virtual screen for tests of the window" $desk || true
    has_desk || say "tests of the window are skipped (Debian, Ubuntu: sudo apt-get install $desk)"
  fi
  rm -f "$venv/apt.log"
  touch "$stamp"
}

case "${1:-}" in
  packages) install_packages "${2:?which extras}" ;;
  opengl) ensure_opengl ;;
  desk) ensure_desk ;;
  *) stop "usage: tools/setup.sh packages EXTRAS | opengl | desk" ;;
esac
