// What the client costs beside the raw stub, for a match of eight objects whose server answers at
// once: prints the medians in microseconds as JSON.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>
#include <vector>

#include "fake_server.hpp"
#include "golden.hpp"

namespace {

using Clock = std::chrono::steady_clock;
namespace v1 = sketchmatch::v1;

constexpr std::uint32_t kObjects = 8;
constexpr int kCalls = 500;

sketchmatch::Source room() {
  std::vector<sketchmatch::Ring> rings;
  for (std::uint32_t k = 0; k < kObjects; ++k) {
    const double left = 10.0 * k;
    rings.push_back({{left, 0}, {left + 4, 0}, {left + 4, 4}, {left, 4}});
  }
  return sketchmatch::sources::polygons(rings);
}

/// The stream of the golden messages, with eight objects and all their relations.
std::vector<v1::MatchResponse> stream() {
  auto events = sketchmatch::test::golden_match();
  auto* scenes = events[1].mutable_scenes();
  auto* result = events[3].mutable_result();
  while (scenes->sketch().objects_size() < static_cast<int>(kObjects)) {
    *scenes->mutable_sketch()->add_objects() = scenes->sketch().objects(0);
    *scenes->mutable_map()->add_objects() = scenes->map().objects(1);
  }
  while (result->object_matches_size() < static_cast<int>(kObjects)) {
    *result->add_object_matches() = result->object_matches(0);
  }
  while (result->fmap_entries_size() < static_cast<int>(kObjects * (kObjects - 1) / 2)) {
    *result->add_fmap_entries() = result->fmap_entries(0);
  }
  const auto progress = events[2];
  events.insert(events.begin() + 2, 20, progress);
  return events;
}

double microseconds(Clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + kCalls / 2, values.end());
  return values[kCalls / 2];
}

}  // namespace

int main() {
  sketchmatch::test::FakeServer server;
  server.events = stream();
  const sketchmatch::Client client(server.address());
  const auto source = room();
  const auto stub = v1::MatchService::NewStub(client.channel());
  v1::MatchRequest request;
  *request.mutable_sketch() = source.message();
  *request.mutable_map() = source.message();

  std::vector<double> ours;
  std::vector<double> raw;
  std::size_t lines = 0;
  for (int k = 0; k < kCalls; ++k) {
    const auto began = Clock::now();
    {
      grpc::ClientContext context;
      const auto reader = stub->Match(&context, request);
      v1::MatchResponse event;
      while (reader->Read(&event)) {
      }
      client.check(reader->Finish());
    }
    const auto between = Clock::now();
    lines += client.match(source, source).result.object_matches.size();
    ours.push_back(microseconds(Clock::now() - between));
    raw.push_back(microseconds(between - began));
  }
  std::cout << "{\"objects\": " << lines / kCalls << ", \"client\": " << median(ours)
            << ", \"raw\": " << median(raw) << "}\n";
  return 0;
}
