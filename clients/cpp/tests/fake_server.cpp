#include "fake_server.hpp"

#include <google/rpc/error_details.pb.h>
#include <grpcpp/health_check_service_interface.h>

#include <chrono>
#include <thread>
#include <utility>

#include "golden.hpp"

namespace sketchmatch::test {

namespace {

/// Answers with the first page that is left, if any.
template <typename Page>
void turn(std::vector<Page>& pages, Page& answer) {
  if (!pages.empty()) {
    answer = pages.front();
    pages.erase(pages.begin());
  }
}

}  // namespace

class FakeServer::Matches final : public v1::MatchService::Service {
 public:
  explicit Matches(FakeServer& fake) : fake_(fake) {}

  grpc::Status Match(grpc::ServerContext* context, const v1::MatchRequest* request,
                     grpc::ServerWriter<v1::MatchResponse>* writer) override {
    if (auto status = fake_.take(*request, *context); !status.ok()) {
      return status;
    }
    const auto breaks = fake_.take_break();
    for (std::size_t k = 0; k < breaks.value_or(fake_.events.size()); ++k) {
      writer->Write(fake_.events.at(k));
    }
    if (breaks) {
      return {grpc::StatusCode::UNAVAILABLE, "away"};
    }
    v1::MatchResponse progress;
    progress.mutable_progress()->set_confidence(0.5);
    while (fake_.endless && !context->IsCancelled()) {
      writer->Write(progress);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    if (context->IsCancelled()) {
      fake_.cancelled();
    }
    return grpc::Status::OK;
  }

  grpc::Status WatchMatch(grpc::ServerContext* context, const v1::WatchMatchRequest* request,
                          grpc::ServerWriter<v1::WatchMatchResponse>* writer) override {
    if (auto status = fake_.take(*request, *context); !status.ok()) {
      return status;
    }
    if (fake_.forgets) {
      return {grpc::StatusCode::NOT_FOUND, "no match is called so"};
    }
    for (const auto& event : fake_.events) {
      if (event.number() > request->after()) {
        v1::WatchMatchResponse response;
        *response.mutable_event() = event;
        writer->Write(response);
      }
    }
    return grpc::Status::OK;
  }

  grpc::Status GetMatch(grpc::ServerContext* context, const v1::GetMatchRequest* request,
                        v1::GetMatchResponse* answer) override {
    *answer = fake_.record;
    return fake_.take(*request, *context);
  }

  grpc::Status CancelMatch(grpc::ServerContext* context, const v1::CancelMatchRequest* request,
                           v1::CancelMatchResponse* answer) override {
    *answer = fake_.stopped;
    return fake_.take(*request, *context);
  }

  grpc::Status ListMatches(grpc::ServerContext* context, const v1::ListMatchesRequest* request,
                           v1::ListMatchesResponse* answer) override {
    turn(fake_.match_pages, *answer);
    return fake_.take(*request, *context);
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Scenes final : public v1::SceneService::Service {
 public:
  explicit Scenes(FakeServer& fake) : fake_(fake) {}

  grpc::Status Segment(grpc::ServerContext* context, const v1::SegmentRequest* request,
                       v1::SegmentResponse* answer) override {
    *answer = fake_.segments;
    return fake_.take(*request, *context);
  }

  grpc::Status PutScene(grpc::ServerContext* context, const v1::PutSceneRequest* request,
                        v1::PutSceneResponse* answer) override {
    *answer = fake_.put;
    return fake_.take(*request, *context);
  }

  grpc::Status GetScene(grpc::ServerContext* context, const v1::GetSceneRequest* request,
                        v1::GetSceneResponse* answer) override {
    *answer = fake_.got;
    return fake_.take(*request, *context);
  }

  grpc::Status ListScenes(grpc::ServerContext* context, const v1::ListScenesRequest* request,
                          v1::ListScenesResponse* answer) override {
    turn(fake_.scene_pages, *answer);
    return fake_.take(*request, *context);
  }

  grpc::Status UpdateScene(grpc::ServerContext* context, const v1::UpdateSceneRequest* request,
                           v1::UpdateSceneResponse* answer) override {
    *answer = fake_.updated;
    return fake_.take(*request, *context);
  }

  grpc::Status DeleteScene(grpc::ServerContext* context, const v1::DeleteSceneRequest* request,
                           v1::DeleteSceneResponse* /*answer*/) override {
    return fake_.take(*request, *context);
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Transfers final : public v1::TransferService::Service {
 public:
  explicit Transfers(FakeServer& fake) : fake_(fake) {}

  grpc::Status Transfer(grpc::ServerContext* context, const v1::TransferRequest* request,
                        v1::TransferResponse* answer) override {
    *answer = fake_.carried;
    return fake_.take(*request, *context);
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Catalog final : public v1::CatalogService::Service {
 public:
  explicit Catalog(FakeServer& fake) : fake_(fake) {}

  grpc::Status ListAlgorithms(grpc::ServerContext* context,
                              const v1::ListAlgorithmsRequest* request,
                              v1::ListAlgorithmsResponse* answer) override {
    *answer = fake_.catalogue;
    return fake_.take(*request, *context);
  }

  grpc::Status GetServerInfo(grpc::ServerContext* context, const v1::GetServerInfoRequest* request,
                             v1::GetServerInfoResponse* answer) override {
    *answer = fake_.info;
    return fake_.take(*request, *context);
  }

 private:
  FakeServer& fake_;
};

FakeServer::FakeServer(int port)
    : events(small_match()),
      matches_(std::make_unique<Matches>(*this)),
      scenes_(std::make_unique<Scenes>(*this)),
      transfers_(std::make_unique<Transfers>(*this)),
      catalog_(std::make_unique<Catalog>(*this)) {
  info.set_api_version("sketchmatch.v1");
  grpc::EnableDefaultHealthCheckService(true);
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:" + std::to_string(port), grpc::InsecureServerCredentials(),
                           &port_);
  builder.RegisterService(matches_.get());
  builder.RegisterService(scenes_.get());
  builder.RegisterService(transfers_.get());
  builder.RegisterService(catalog_.get());
  server_ = builder.BuildAndStart();
  server_->GetHealthCheckService()->SetServingStatus("sketchmatch.v1.MatchService", true);
}

FakeServer::~FakeServer() {
  server_->Shutdown(std::chrono::system_clock::now());
  server_->Wait();
}

void FakeServer::fail(const google::rpc::Status& status, int times) {
  const std::lock_guard lock(mutex_);
  error_ = status;
  fails_ = times;
}

void FakeServer::set_serving(bool serving) {
  server_->GetHealthCheckService()->SetServingStatus(serving);
}

std::vector<std::string> FakeServer::requests() {
  const std::lock_guard lock(mutex_);
  return requests_;
}

std::vector<std::string> FakeServer::authorizations() {
  const std::lock_guard lock(mutex_);
  return authorizations_;
}

bool FakeServer::wait_until_cancelled() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::minutes(1), [this] { return cancelled_; });
}

std::optional<std::size_t> FakeServer::take_break() {
  const std::lock_guard lock(mutex_);
  return std::exchange(breaks_after, std::nullopt);
}

grpc::Status FakeServer::take(const google::protobuf::Message& request,
                              const grpc::ServerContext& context) {
  const std::lock_guard lock(mutex_);
  constexpr std::size_t kMost = 1'000;  // so that memory can be measured
  if (requests_.size() < kMost) {
    requests_.push_back(as_text(request));
    const auto& metadata = context.client_metadata();
    const auto found = metadata.find("authorization");
    authorizations_.emplace_back(
        found == metadata.end() ? "" : std::string(found->second.begin(), found->second.end()));
  }
  if (fails_ == 0) {
    return grpc::Status::OK;
  }
  --fails_;
  return {static_cast<grpc::StatusCode>(error_.code()), error_.message(),
          error_.details_size() > 0 ? error_.SerializeAsString() : std::string()};
}

void FakeServer::cancelled() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
  changed_.notify_all();
}

std::vector<v1::MatchResponse> small_match() {
  std::vector<v1::MatchResponse> events(6);
  events[0].mutable_accepted()->set_match_id("m1");
  events[0].mutable_accepted()->set_seed(7);
  events[1].mutable_scenes()->add_sketch_warnings("one left out");
  events[2].mutable_progress()->set_confidence(0.5);
  events[4].mutable_progress()->set_confidence(0.75);
  auto* result = events[5].mutable_result();
  result->set_match_id("m1");
  result->set_outcome(v1::OUTCOME_CONVERGED);
  for (const auto& [sketch, map] : {std::pair{0U, 2U}, std::pair{1U, 0U}}) {
    auto* line = result->add_object_matches();
    line->set_sketch_object(sketch);
    line->set_map_object(map);
    line->set_confidence(0.9);
  }
  return events;
}

std::vector<v1::MatchResponse> golden_match() {
  std::vector<v1::MatchResponse> events;
  for (const char* kind : {"accepted", "scenes", "progress", "result"}) {
    events.push_back(golden<v1::MatchResponse>(std::string("MatchResponse.") + kind));
  }
  return events;
}

google::rpc::Status status_of(grpc::StatusCode code, const std::string& message,
                              const std::string& reason, double retry_after) {
  google::rpc::Status status;
  status.set_code(static_cast<int>(code));
  status.set_message(message);
  if (!reason.empty()) {
    google::rpc::ErrorInfo info;
    info.set_domain("sketchmatch");
    info.set_reason(reason);
    status.add_details()->PackFrom(info);
  }
  if (retry_after >= 0.0) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_nanos(static_cast<int>(retry_after * 1e9));
    status.add_details()->PackFrom(retry);
  }
  return status;
}

}  // namespace sketchmatch::test
