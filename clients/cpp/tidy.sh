#!/usr/bin/env bash
# Lets clang-format and clang-tidy look at the library, as configured in build/cpp; or clang-tidy at
# the files that are named.
set -euo pipefail
cd "$(dirname "$0")/../.."
find clients/cpp -name '*.?pp' -print0 | xargs -0 clang-format --dry-run --Werror
if (($# == 0)); then set -- clients/cpp/src/*.cpp; fi
clang-tidy --quiet -p build/cpp --extra-arg=-std=c++17 "$@"
