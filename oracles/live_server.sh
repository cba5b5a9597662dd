#!/usr/bin/env bash
# A loaded live engine through a real PulseAudio server: 300 contacts, a cloth and a sheet of paper at once, in blocks of 128
# frames. The server's output is recorded and held against what it was given.
#
#     oracles/live_server.sh [SECONDS [BLOCK [FOLDER]]]
#
# Needs PulseAudio (in Debian: pulseaudio pulseaudio-utils libasound2-dev). Whoever may give real-time priority (root, or by the
# limit `rtprio`) gets a server of their own, apart from any other, all of whose threads have it. Otherwise a server that runs
# already is used, or one is started without. Whatever was started or changed is undone at the end, also where something fails.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-30}
block=${2:-128}
folder=${3:-$(mktemp -d)}
mkdir -p "$folder"

cargo build --release -p froufrou-cli --no-default-features --features device --example live_server
binary=${CARGO_TARGET_DIR:-target}/release/examples/live_server

runtime='' server='' recorder='' sink='' before='' watchers=()
clean_up() {
    for watcher in "${watchers[@]}"; do kill "$watcher" 2>/dev/null && wait "$watcher" || true; done
    if [ -n "$recorder" ]; then kill "$recorder" 2>/dev/null && wait "$recorder" || true; fi
    if [ -n "$before" ]; then pactl set-default-sink "$before" || true; fi
    if [ -n "$sink" ]; then pactl unload-module "$sink" || true; fi
    if [ -n "$server" ]; then kill "$server" 2>/dev/null && wait "$server" || true; fi
    if [ -n "$runtime" ]; then rm -rf "$runtime"; fi
}
trap clean_up EXIT
trap 'exit 130' INT TERM

is_urgent=false
if chrt --rr 5 true 2>/dev/null; then is_urgent=true; fi
if $is_urgent || ! pactl info >/dev/null 2>&1; then
    runtime=$(mktemp -d)
    export PULSE_RUNTIME_PATH=$runtime PULSE_SERVER=unix:$runtime/native
    pulseaudio -n --daemonize=no --use-pid-file=no --exit-idle-time=-1 --realtime=yes \
        --load="module-native-protocol-unix auth-anonymous=1 socket=$runtime/native" 2>"$folder/server.txt" &
    server=$!
    for _ in $(seq 100); do pactl info >/dev/null 2>&1 && break || sleep 0.1; done
else
    # Clients that are not of PulseAudio itself do not look for it everywhere.
    PULSE_SERVER=${PULSE_SERVER:-$(pactl info | sed -n 's/^Server String: \(unix:\)\?/unix:/p')}
    export PULSE_SERVER
    before=$(pactl get-default-sink)
fi
sink=$(pactl load-module module-null-sink sink_name=frou rate=48000 format=float32le channels=2)
pactl set-default-sink frou
if [ -n "$server" ] && $is_urgent; then
    # PulseAudio asks for it for the thread of a sink alone. What clients write goes through its main thread, which where other
    # programs keep the processor from it is late by more than the two blocks that the sink holds: a gap that is not ours.
    chrt --all-tasks --rr --pid 5 "$server"
    echo "a server of its own, with real-time priority"
else
    echo "a server without real-time priority for all of it: other programs may make it late"
fi
parec -d frou.monitor --latency-msec=20 --format=float32le --rate=48000 --channels=2 >"$folder/recorded.f32" &
recorder=$!
rm -f "$folder"/watch-*.csv
if $is_urgent; then
    # Whether a core runs at all is seen by who may run before all others.
    for core in $(seq 0 $(($(nproc) - 1))); do
        taskset --cpu-list "$core" chrt --rr 20 "$binary" watch "$folder/watch-$core.csv" &
        watchers+=($!)
    done
fi
sleep 1
"$binary" play "$folder" --seconds "$seconds" --block "$block" | tee "$folder/played.txt"
sleep 1
kill "$recorder"
wait "$recorder" 2>/dev/null || true
recorder=''
"$binary" compare "$folder" | tee "$folder/compared.txt"
echo "all of it is in $folder"
