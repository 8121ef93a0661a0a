# For sourcing: find_python MODULE... prints the first interpreter that has them: Debian's, even if
# another comes first in PATH.

find_python() {
    local python modules
    modules=$(printf ', %s' "$@")
    for python in python3 /usr/bin/python3; do
        if "$python" -c "import ${modules#, }" >/dev/null 2>&1 </dev/null; then
            printf '%s\n' "$python"
            return
        fi
    done
    printf 'no python3 with %s\n' "${modules#, }" >&2
    return 1
}
