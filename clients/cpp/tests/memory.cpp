// What many calls leave behind: prints how many bytes the process has grown by as JSON.
//
//   memory 10000 [ADDRESS SKETCH MAP.yaml]
//
// Of ten calls nine are matches, a third of which are stopped, and one asks for the catalogue. With
// an address, a real server answers; it is asked for few matches, which take long there.
#include <malloc.h>
#include <unistd.h>

#include <fstream>
#include <iostream>
#include <memory>
#include <sketchmatch/sketchmatch.hpp>
#include <string>

#include "fake_server.hpp"
#include "golden.hpp"

namespace {

using sketchmatch::Client;
using sketchmatch::Source;

std::int64_t resident_bytes() {
  malloc_trim(0);
  std::ifstream statm("/proc/self/statm");
  std::int64_t total = 0;
  std::int64_t resident = 0;
  statm >> total >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

void call(const Client& client, const Source& sketch, const Source& map, int number, bool real) {
  if (real ? number % 20 != 0 : number % 10 == 9) {
    static_cast<void>(client.algorithms());
  } else if (number % 3 == 0 && !real) {
    auto stopped = client.events(sketch, map);
    stopped.next();
    stopped.cancel();
  } else if (number % 3 == 1 && !real) {
    static_cast<void>(client.match_async(sketch, map).get());
  } else {
    static_cast<void>(client.match(sketch, map));
  }
}

}  // namespace

int main(int count, char** arguments) {
  const int calls = count > 1 ? std::stoi(arguments[1]) : 10'000;
  const bool real = count == 5;
  std::unique_ptr<sketchmatch::test::FakeServer> server;
  std::string address;
  auto sketch = sketchmatch::sources::polygons({{{0, 0}, {1, 0}, {1, 1}}}, {"bed"});
  auto map = sketch;
  if (real) {
    address = arguments[2];
    sketch = sketchmatch::sources::file(arguments[3]);
    map = sketchmatch::sources::map_server_map(arguments[4]);
  } else {
    server = std::make_unique<sketchmatch::test::FakeServer>();
    server->events = sketchmatch::test::golden_match();
    server->catalogue = sketchmatch::test::golden<sketchmatch::v1::ListAlgorithmsResponse>(
        "ListAlgorithmsResponse");
    address = server->address();
  }
  const Client client(address);
  for (int k = 0; k < calls / 5; ++k) {  // until buffers have grown to their size
    call(client, sketch, map, k, real);
  }
  const auto before = resident_bytes();
  for (int k = 0; k < calls; ++k) {
    call(client, sketch, map, k, real);
  }
  const auto after = resident_bytes();
  std::cout << "{\"calls\": " << calls << ", \"before\": " << before
            << ", \"grown\": " << after - before << "}\n";
  return 0;
}
