// Five lines to a first answer: which sketched object is which object on the map?
//
//   first_answer localhost:50051 sketch.svg room.yaml
#include <iostream>
#include <sketchmatch/sketchmatch.hpp>

int main(int count, char** arguments) {
  if (count != 4) {
    std::cerr << "usage: first_answer ADDRESS SKETCH MAP.yaml\n";
    return 2;
  }
  try {
    const sketchmatch::Client client(arguments[1]);
    const auto sketch = sketchmatch::sources::file(arguments[2]);
    const auto map = sketchmatch::sources::map_server_map(arguments[3]);
    std::cout << client.match(sketch, map) << '\n';
  } catch (const sketchmatch::SketchmatchError& error) {
    std::cerr << "first_answer: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
