#!/bin/sh
# All photos of a folder -> searchable PDFs in another, two at a time: batch.sh PHOTOS PDFS
#
# A photo whose PDF exists already is left out, so that the script can be run again after an interruption.
set -eu
photos=${1:?the folder with the photos} pdfs=${2:?the folder for the PDFs}
export RECTIFY_URL="${RECTIFY_URL:-http://127.0.0.1:8000}" PDFS="$pdfs"
mkdir -p "$pdfs"
find "$photos" -maxdepth 1 -type f \( -iname '*.jpg' -o -iname '*.jpeg' -o -iname '*.png' -o -iname '*.heic' \) -print0 |
	xargs -0 -r -n 1 -P 2 sh -c '
		name=$(basename "$1"); pdf="$PDFS/${name%.*}.pdf"
		[ -e "$pdf" ] && exit 0
		if curl --fail --silent --show-error --retry 5 -F "image=@$1" -F text=true -F format=pdf \
			"$RECTIFY_URL/rectify" -o "$pdf.part"; then mv "$pdf.part" "$pdf"
		else rm -f "$pdf.part"; echo "$name: not flattened" >&2; fi' sh
