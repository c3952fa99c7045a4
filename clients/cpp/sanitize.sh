#!/usr/bin/env bash
# Builds the tests with sanitizers and runs them: sanitize.sh address,undefined, or thread.
set -euo pipefail
cd "$(dirname "$0")/../.."
sanitizers=${1:-address,undefined}
build=build/cpp-${sanitizers//,/-}
flags=-O1
# With the macro, protobuf's headers have other members than the system's library.
if [ "$sanitizers" = thread ]; then flags+=" -U__SANITIZE_THREAD__"; fi
# In few pieces: headers take most of the compiler's time.
cmake -S clients/cpp -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS="$flags" \
  -DCMAKE_UNITY_BUILD=ON -DSKETCHMATCH_BUILD_EXAMPLES=OFF -DSKETCHMATCH_BUILD_TESTS=ON \
  -DSKETCHMATCH_SANITIZE="$sanitizers" >/dev/null
cmake --build "$build" --parallel 2 --target sketchmatch_tests
# The system's gRPC is not built for it, so that its locks are unknown.
export TSAN_OPTIONS="suppressions=$PWD/clients/cpp/tests/tsan.supp ${TSAN_OPTIONS:-}"
export UBSAN_OPTIONS="print_stacktrace=1 ${UBSAN_OPTIONS:-}"
ctest --test-dir "$build" --output-on-failure
