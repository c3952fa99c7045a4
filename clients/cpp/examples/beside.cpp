// A match that runs beside whatever else there is to do, with callbacks, a future and a button that
// stops it.
//
//   beside localhost:50051 sketch.svg room.yaml
#include <chrono>
#include <iostream>
#include <sketchmatch/sketchmatch.hpp>

int main(int count, char** arguments) {
  if (count != 4) {
    std::cerr << "usage: beside ADDRESS SKETCH MAP.yaml\n";
    return 2;
  }
  try {
    const sketchmatch::Client client(arguments[1]);
    const auto sketch = sketchmatch::sources::file(arguments[2]);
    const auto map = sketchmatch::sources::map_server_map(arguments[3]);

    sketchmatch::MatchCallbacks callbacks;
    callbacks.on_progress = [](const sketchmatch::Progress& progress) {
      std::cerr << progress << '\n';
    };
    auto match = client.match_async(sketch, map, {}, callbacks);
    // Other work goes here. A button calls match.cancel(), from any thread.
    if (match.future().wait_for(std::chrono::seconds(120)) != std::future_status::ready) {
      match.cancel();
    }
    for (const auto& [drawn, mapped] : match.get().object_map()) {
      std::cout << drawn << " is " << mapped << '\n';
    }
  } catch (const sketchmatch::CallCancelledError&) {
    std::cerr << "beside: it took too long\n";
    return 1;
  } catch (const sketchmatch::SketchmatchError& error) {
    std::cerr << "beside: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
