#!/usr/bin/env bash
# The merge of submit.sh: each frame as a multilayer OpenEXR file.
set -euo pipefail

main="import importlib; importlib.import_module('$ADDON.farm.command').main()"
exec "$BLENDER" -b --addons "$ADDON" --python-exit-code 1 --python-expr "$main" -- merge "$VOLLEY_FOLDER/parts" \
    --frames "$VOLLEY_FIRST-$VOLLEY_LAST" --output "$VOLLEY_FOLDER/frames/frame_####" </dev/null
