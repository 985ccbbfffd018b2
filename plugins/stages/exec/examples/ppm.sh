#!/bin/sh
# A writer in a shell: each image as a PPM file. Needs head, od and tail of GNU, unzip and zip.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

# Reads a message into message.npz. Ends at the end of the messages.
receive() {
    head -c 8 > start
    [ "$(wc -c < start)" -eq 8 ] || exit 0
    head -c "$(od -An -tu4 -j4 start | tr -d ' ')" > message.npz
}

# Prints the elements of an array of the message.
elements() {
    unzip -p message.npz "$1.npy" > array
    tail -c +$(($(od -An -tu2 -j8 -N2 array) + 11)) array
}

# Prints an array of the bytes of standard input.
array_of_bytes() {
    cat > bytes
    printf "\223NUMPY\001\000v\000%-117s\n" "{'descr': '|u1', 'fortran_order': False, 'shape': ($(wc -c < bytes),), }"
    cat bytes
}

# Answers with the number of the message, and with the files of arrays that are named.
answer() {
    rm -f answer.npz
    unzip -q -o message.npz syntable_number.npy
    zip -q -0 answer.npz syntable_number.npy "$@"
    length=$(wc -c < answer.npz)
    printf SYN1
    for shift in 0 8 16 24; do
        printf "\\$(printf %03o $(((length >> shift) & 255)))"
    done
    cat answer.npz
}

mkdir ppm
while receive; do
    case $(elements syntable_message | tr -d '\0') in
    view)
        set -- $(elements syntable_size | od -An -tu8)
        path=ppm/$(printf %06d $(elements syntable_scene | od -An -tu8))_$(printf %04d $(elements syntable_view | od -An -tu8)).ppm
        { printf 'P6\n%d %d\n255\n' "$2" "$1"; elements rgb; } | array_of_bytes > "$path.npy"
        answer "$path.npy"
        rm "$path.npy"
        ;;
    *) answer ;;
    esac
done
