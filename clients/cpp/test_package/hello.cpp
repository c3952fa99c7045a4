#include <iostream>
#include <sketchmatch/sketchmatch.hpp>

int main() {
  const sketchmatch::Client client("localhost:1");
  try {
    client.wait_until_serving(sketchmatch::Seconds(0.1));
  } catch (const sketchmatch::ServerUnavailableError& error) {
    std::cout << error.what() << '\n';  // nobody serves there
    return 0;
  }
  return 1;
}
