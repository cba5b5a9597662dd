#!/usr/bin/env bash
# A loaded live engine through a real PulseAudio server: 300 contacts, a cloth and a sheet of paper at once, in blocks of 128
# frames. The server's output is recorded and held against what it was given.
#
#     oracles/live_server.sh [SECONDS [BLOCK [FOLDER]]]
#
# Needs PulseAudio (in Debian: pulseaudio pulseaudio-utils libasound2-dev). A server that runs already is used; otherwise one is
# started, and ended again.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-30}
block=${2:-128}
folder=${3:-$(mktemp -d)}
mkdir -p "$folder"

cargo build --release -p froufrou-cli --no-default-features --features device --example live_server
binary=${CARGO_TARGET_DIR:-target}/release/examples/live_server

if ! pactl info >/dev/null 2>&1; then
    pulseaudio --start --exit-idle-time=-1
    trap 'pulseaudio --kill' EXIT
fi
# Clients that are not of PulseAudio itself do not look for it everywhere.
PULSE_SERVER=${PULSE_SERVER:-$(pactl info | sed -n 's/^Server String: \(unix:\)\?/unix:/p')}
export PULSE_SERVER
module=$(pactl load-module module-null-sink sink_name=frou rate=48000 format=float32le channels=2)
pactl set-default-sink frou
parec -d frou.monitor --latency-msec=20 --format=float32le --rate=48000 --channels=2 >"$folder/recorded.f32" &
recorder=$!
sleep 1
"$binary" play "$folder" --seconds "$seconds" --block "$block" | tee "$folder/played.txt"
sleep 1
kill "$recorder"
wait "$recorder" 2>/dev/null || true
pactl unload-module "$module"
"$binary" compare "$folder" | tee "$folder/compared.txt"
echo "all of it is in $folder"
