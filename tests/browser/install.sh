#!/usr/bin/env bash
# Install Debian's Chromium, in which the page is tested, unless there is one (root on Debian). Playwright fetches none.
set -euo pipefail
if [ -x /usr/bin/chromium ]; then
  exit 0
fi
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
apt-get install -y -qq --no-install-recommends chromium >/dev/null
/usr/bin/chromium --version
