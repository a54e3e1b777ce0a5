#!/usr/bin/env bash
# A PostgreSQL of its own for the optional test of a remote tracking server. Needs root and Debian's package, which
# `start` installs if it is missing. All its files lie in FOLDER; the database is postgresql://fractal@127.0.0.1:PORT/mlflow
#
#   tests/cli/postgres.sh start FOLDER PORT
#   tests/cli/postgres.sh stop FOLDER
set -euo pipefail
action=$1
folder=$(realpath -m "$2")
programs() { find /usr/lib/postgresql -maxdepth 2 -name bin 2>/dev/null | sort -V | tail -1; }
as_postgres() { (cd / && runuser -u postgres -- "$@"); }

start() {
  if [ -z "$(programs)" ] || ! id postgres >/dev/null 2>&1; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends postgresql
  fi
  bin=$(programs)
  mkdir -p "$folder"
  chown postgres "$folder"
  as_postgres "$bin/initdb" --pgdata="$folder/data" --username=fractal --auth=trust >"$folder/initdb.log"
  as_postgres "$bin/pg_ctl" --pgdata="$folder/data" --log="$folder/postgres.log" --wait \
    --options="-p $1 -k $folder -c listen_addresses=127.0.0.1" start >/dev/null
  as_postgres "$bin/createdb" --host=127.0.0.1 --port="$1" --username=fractal mlflow
}

stop() {
  as_postgres "$(programs)/pg_ctl" --pgdata="$folder/data" --mode=fast --wait stop >/dev/null
}

case $action in
  start) start "$3" ;;
  stop) stop ;;
  *) echo "start or stop, got $action" >&2; exit 2 ;;
esac
