#!/bin/sh
# Pre-consume script of Paperless-ngx (PAPERLESS_PRE_CONSUME_SCRIPT): a photo becomes a flat, searchable PDF.
#
# Paperless names its working copy in DOCUMENT_WORKING_PATH and consumes what is there when the script ends. Set
# RECTIFY_URL, and RECTIFY_KEY where the service wants a key. What is no photo of a page stays as it is.
set -eu
: "${RECTIFY_URL:=http://127.0.0.1:8000}" "${RECTIFY_LANGUAGE:=}" "${RECTIFY_TIMEOUT_S:=300}"
photo=${DOCUMENT_WORKING_PATH:?Paperless-ngx sets this}
case $(printf %s "$photo" | tr '[:upper:]' '[:lower:]') in
*.jpg | *.jpeg | *.png | *.webp | *.tif | *.tiff | *.heic) ;;
*) exit 0 ;;
esac
flat=$(mktemp)
trap 'rm -f "$flat"' EXIT
set -- -F "image=@$photo" -F text=true -F format=pdf -F on_no_text=keep
[ -z "$RECTIFY_LANGUAGE" ] || set -- "$@" -F "language=$RECTIFY_LANGUAGE"
[ -z "${RECTIFY_KEY:-}" ] || set -- "$@" -H "X-API-Key: $RECTIFY_KEY"
if curl --fail --silent --show-error --retry 5 --max-time "$RECTIFY_TIMEOUT_S" \
	"$@" "$RECTIFY_URL/rectify" -o "$flat"; then
	cat "$flat" >"$photo"
else
	echo "The photo was not flattened; Paperless gets it as it is." >&2
fi
