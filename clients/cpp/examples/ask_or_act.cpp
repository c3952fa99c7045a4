// What a robot's interface does with an answer: refuse, ask or act.
//
//   ask_or_act localhost:50051
//
// The sketch is what a pen drew on a tablet, where y grows downwards; the map is an occupancy grid
// as a robot has it in memory. Both are made up here.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <iostream>
#include <sketchmatch/sketchmatch.hpp>
#include <vector>

namespace {

using sketchmatch::StrokePoint;

constexpr std::uint32_t kColumns = 200;
constexpr std::uint32_t kRows = 150;

void occupy(std::vector<std::int8_t>& cells, std::uint32_t left, std::uint32_t low,
            std::uint32_t width, std::uint32_t height) {
  for (std::uint32_t row = low; row < low + height; ++row) {
    const auto begin = cells.begin() + static_cast<std::ptrdiff_t>(row * kColumns + left);
    std::fill_n(begin, width, std::int8_t{100});
  }
}

sketchmatch::Source room() {
  std::vector<std::int8_t> cells(std::size_t{kColumns} * kRows, 0);
  occupy(cells, 20, 110, 60, 20);
  occupy(cells, 150, 30, 12, 12);
  occupy(cells, 30, 20, 25, 45);
  occupy(cells, 120, 90, 40, 30);
  return sketchmatch::sources::occupancy_grid(cells, kColumns, 0.05);
}

std::vector<StrokePoint> box(double left, double top, double width, double height) {
  return {{left, top},
          {left + width, top},
          {left + width, top + height},
          {left, top + height},
          {left, top + 1}};
}

sketchmatch::Source drawing() {
  return sketchmatch::sources::strokes(
      {box(20, 20, 58, 22), box(151, 106, 13, 12), box(32, 85, 24, 44), box(118, 32, 42, 29)},
      {"sofa", "plant", "desk", "table"}, sketchmatch::YAxis::down);
}

int answer(const sketchmatch::Match& match) {
  const auto& result = match.result;
  if (result.place_probability && *result.place_probability < 0.5) {
    std::cout << "this is probably another place\n";
    return 0;
  }
  if (result.ambiguity && !result.ambiguity->deciding_sketch_objects.empty()) {
    const auto asked = result.ambiguity->deciding_sketch_objects.front();
    std::cout << "please tell which one object " << asked << " is\n";
    return 0;
  }
  for (const auto& line : result.object_matches) {
    const auto& place = match.scenes.map.objects.at(line.map_object).centroid;
    std::cout << line.sketch_label << " is at " << place.x << ", " << place.y << '\n';
  }
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: ask_or_act ADDRESS\n";
    return 2;
  }
  try {
    const sketchmatch::Client client(arguments[1]);
    client.wait_until_serving(std::chrono::seconds(60));
    sketchmatch::MatchOptions options;
    options.time_budget = std::chrono::seconds(5);
    options.params["map_segmenter"]["min_size"] = 0.3;
    return answer(
        client.match(drawing(), room(), options,
                     [](const sketchmatch::Progress& progress) { std::cerr << progress << '\n'; }));
  } catch (const sketchmatch::InvalidRequestError& error) {
    std::cerr << "ask_or_act: correct " << error.field() << ": " << error.what() << '\n';
  } catch (const sketchmatch::SketchmatchError& error) {
    std::cerr << "ask_or_act: " << error.what() << '\n';
  }
  return 1;
}
