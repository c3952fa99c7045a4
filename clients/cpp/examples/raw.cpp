// The generated messages and stubs beside the client, for what the client does not offer: they use
// its connection, its token and its errors.
//
//   raw localhost:50051
#include <iostream>
#include <sketchmatch/raw.hpp>
#include <sketchmatch/sketchmatch.hpp>

namespace v1 = sketchmatch::v1;

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: raw ADDRESS\n";
    return 2;
  }
  try {
    const sketchmatch::Client client(arguments[1]);
    const auto stub = v1::CatalogService::NewStub(client.channel());

    grpc::ClientContext context;
    client.authorize(context);
    v1::GetServerInfoResponse info;
    client.check(stub->GetServerInfo(&context, {}, &info));
    std::cout << info.DebugString();
  } catch (const sketchmatch::SketchmatchError& error) {
    std::cerr << "raw: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
