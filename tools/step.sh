# Sourced by the scripts of this folder: runs long commands quietly, with a line of progress, and shows the log if they
# fail.

cd "$(dirname "${BASH_SOURCE[0]}")/.."
log_dir=out/log
mkdir -p "$log_dir"

say() { printf '%s\n' "$*"; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

# limited COMMAND...: runs a test program with a time limit.
limited() {
  local status=0
  timeout -k 10 1800 "$@" || status=$?
  ((status != 124)) || say "$1 hung: ended after half an hour"
  return $status
}

# progress LOG: a short status of a running command: ninja's counter if there is one, otherwise the log's last line.
progress() {
  local text
  text=$(tail -c 400 "$1" 2>/dev/null | tr '\r' '\n' | grep -v '^[[:space:]]*$' | tail -n 1 || true)
  if [[ $text =~ ^\[[0-9]+/[0-9]+\] ]]; then text=${BASH_REMATCH[0]}; fi
  printf '%.70s' "$text"
}

# step NAME "description" COMMAND...: writes the command's output to out/log/NAME.log. A terminal shows one updated
# line, other outputs get a line every 15 seconds.
step() {
  local name=$1 title=$2 log=$log_dir/$1.log start=$SECONDS shown=0 child status=0
  shift 2
  [ -t 1 ] || say "$title ..."
  "$@" >"$log" 2>&1 &
  child=$!
  trap 'kill "$child" 2>/dev/null; wait "$child" 2>/dev/null; exit 130' INT TERM
  while kill -0 "$child" 2>/dev/null; do
    if [ -t 1 ]; then
      printf '\r\033[K%s ... %d s  %s' "$title" $((SECONDS - start)) "$(progress "$log")"
    elif ((SECONDS - start >= shown + 15)); then
      shown=$((SECONDS - start))
      say "  $shown s  $(progress "$log")"
    fi
    sleep 0.2
  done
  wait "$child" || status=$?
  trap - INT TERM
  [ -t 1 ] && printf '\r\033[K'
  if ((status)); then
    say "$title: failed after $((SECONDS - start)) s. The end of $log:"
    tail -n 60 "$log" | sed 's/^/    /'
    exit "$status"
  fi
  say "$title: $((SECONDS - start)) s"
}
