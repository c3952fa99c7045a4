#!/usr/bin/env bash
# Builds the tests with sanitizers and runs them, in build/cpp where the tests are configured:
# sanitize.sh address,undefined, or thread.
set -euo pipefail
cd "$(dirname "$0")/../.."
program=sketchmatch_tests_$(tr , _ <<<"${1:-address,undefined}")
cmake --build build/cpp --parallel 2 --target "$program"
# The system's gRPC is not built for it, so that its locks are unknown.
export TSAN_OPTIONS="suppressions=$PWD/clients/cpp/tests/tsan.supp ${TSAN_OPTIONS:-}"
export LSAN_OPTIONS="suppressions=$PWD/clients/cpp/tests/lsan.supp:print_suppressions=0 ${LSAN_OPTIONS:-}"
export UBSAN_OPTIONS="print_stacktrace=1 ${UBSAN_OPTIONS:-}"
"build/cpp/tests/$program" --gtest_brief=1
