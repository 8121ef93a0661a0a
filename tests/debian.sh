# What scripts share that install from Debian's mirrors: packages here, and suites in folders of their own.
#
# For the latter the script that sources this sets SUITE ("trixie"), NAME (for people, "Debian 13"), ROOT (the
# folder) and PACKAGES, and defines skip, which says why there can be no such Debian here and ends the script.
CACHE=${XDG_CACHE_HOME:-$HOME/.cache}/volley

say() { printf '== %(%T)T %s\n' -1 "$*"; }

# Installs packages that are missing here, as root or through sudo.
install_here() {
    local package missing=()
    for package in "$@"; do
        [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
            missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    say "Installing: ${missing[*]}"
    set -- env DEBIAN_FRONTEND=noninteractive apt-get -q
    [ "$(id -u)" -eq 0 ] || set -- sudo "$@"
    "$@" update </dev/null
    "$@" install -y --no-install-recommends "${missing[@]}" </dev/null
}

# In a mount name space of its own, where there may be one: what is mounted there goes away with it.
in_private() {
    if unshare --mount true 2>/dev/null; then
        unshare --mount "$@"
    else
        "$@"
    fi
}

inside() {
    in_private sh -c 'mount -t proc proc "$0/proc" 2>/dev/null; exec chroot "$0" "$@"' "$ROOT" \
        env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
        ${http_proxy:+http_proxy="$http_proxy"} "$@" </dev/null
}

# The mirror that this system installs from.
mirror() {
    local found
    found=$(apt-get indextargets --format '$(SITE) $(REPO_URI)' 'Created-By: Packages' 2>/dev/null |
        sed -n 's|^[^ ]* \(.*/debian/\{0,1\}\)$|\1|p' | head -n 1)
    printf '%s\n' "${found:-http://deb.debian.org/debian}"
}

# Packages without documentation and without waiting for the disk: the folder can be made again.
configure_packages() {
    printf '%s\n' force-unsafe-io 'path-exclude=/usr/share/doc/*' 'path-exclude=/usr/share/man/*' \
        'path-exclude=/usr/share/locale/*' >"$ROOT/etc/dpkg/dpkg.cfg.d/volley"
    # Mirrors of unstable may lag behind: what they have is as good.
    printf '%s\n' 'Acquire::Languages "none";' 'APT::Install-Recommends "false";' \
        'Acquire::Check-Valid-Until "false";' >"$ROOT/etc/apt/apt.conf.d/volley"
}

make_root() {
    local log=$ROOT.debootstrap.log proxy="" part=$ROOT.part
    [ "$(id -u)" -eq 0 ] || skip "changing into its folder needs root"
    [ ! -d "$ROOT" ] || return 0
    if ! command -v debootstrap >/dev/null; then
        { apt-get update -q && apt-get install -q -y --no-install-recommends debootstrap; } \
            </dev/null >/dev/null 2>&1 || skip "debootstrap cannot be installed"
    fi
    eval "$(apt-config shell proxy Acquire::http::Proxy)"
    [ -z "$proxy" ] || export http_proxy=$proxy
    mkdir -p "$CACHE"
    rm -rf "$part"
    say "$NAME into $ROOT"
    in_private debootstrap --variant=minbase "$SUITE" "$part" "$(mirror)" >"$log" 2>&1 </dev/null ||
        { tail -n 5 "$log"; skip "debootstrap failed, see $log"; }
    mv "$part" "$ROOT"
}

install_packages() {
    local log=$ROOT.packages.log
    if inside dpkg-query -W -f '${db:Status-Status}\n' "${PACKAGES[@]}" 2>/dev/null |
        awk '$1 != "installed" { bad = 1 } END { exit bad || NR < '${#PACKAGES[@]}' }'; then
        return
    fi
    say "Packages of $NAME"
    configure_packages
    { inside apt-get update -q &&
        inside env DEBIAN_FRONTEND=noninteractive apt-get install -q -y "${PACKAGES[@]}"; } \
        >"$log" 2>&1 || { tail -n 5 "$log"; skip "its packages cannot be installed, see $log"; }
}
