#!/usr/bin/env bash
# A worked example of what `guardsplat hook listen` runs for each job that is over: puts marked scenes where the website
# serves them from, and notes the others.
#
#   guardsplat hook listen --secret-file hook.secret --folder marked -- deploy/hooks/publish.sh PUBLIC
#
# PUBLIC is the folder that the website serves. A scene is called as its job is (GUARDSPLAT_DISPLAY_NAME is what the
# website called it, which a stranger may have chosen: it is a line in a list here, and never a path). May be called twice
# for the same job.
set -euo pipefail

public=${1:?publish hook: wants the folder to publish in}
job=${GUARDSPLAT_JOB#jobs/}
# The event is on standard input, for whoever wants more of it than the variables have.
cat >/dev/null

case $GUARDSPLAT_KIND/$GUARDSPLAT_STATE in
    embed/succeeded)
        scene=${GUARDSPLAT_SCENE:?publish hook: run with --folder, which fetches scenes}
        name=${scene##*/}
        # Whole or not at all.
        cp -- "$scene" "$public/.$name.part"
        mv -- "$public/.$name.part" "$public/$name"
        ;;
    embed/*)
        # Nobody gets a scene that has no mark. Somebody should look why.
        echo "publish hook: $job has $GUARDSPLAT_STATE; asset: ${GUARDSPLAT_DISPLAY_NAME:-unnamed}" >&2
        ;;
esac
