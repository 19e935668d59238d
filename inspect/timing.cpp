#include "inspect/timing.h"

#include <time.h>

#include <algorithm>
#include <cstdint>

#include "engine/state/ignored_pairs.h"

namespace clearance {

namespace {

constexpr std::size_t kSampledPartners = 64;  // of a body whose pairs are timed
constexpr int kRounds = 5;                    // the median of so many timings counts

double thread_ns() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

engine::Engine::Options one_thread() {
  engine::Engine::Options options;
  options.threads = 1;
  options.covers = engine::Covers::kOff;
  return options;
}

std::vector<std::uint32_t> parents_of(const engine::Scene& scene) {
  std::vector<std::uint32_t> parents;
  for (const Body& body : scene.bodies()) parents.push_back(body.parent);
  return parents;
}

}  // namespace

PairTimes::PairTimes(const engine::Scene& scene)
    : scene_(scene), engine_(scene, one_thread()), table_(scene, parents_of(scene), IgnoredPairs(scene).all()) {
  for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) {
    const BodyState state = engine_.body_state(b);
    placed_.push_back(state.status == Status::kOk);
    poses_.push_back(state.X_wb);
  }
}

std::vector<BodyPair> PairTimes::sampled(std::uint32_t body) const {
  const auto n = static_cast<std::uint32_t>(scene_.bodies().size());
  std::vector<BodyPair> pairs;
  const std::uint32_t stride = std::max<std::uint32_t>(1, n / (2 * kSampledPartners));
  for (std::uint32_t first = 0; first < stride && pairs.size() < kSampledPartners; ++first)
    for (std::uint32_t p = first; p < n && pairs.size() < kSampledPartners; p += stride)
      if (placed_[body] && placed_[p] && table_.enabled(body, p)) pairs.push_back({body, p});
  return pairs;
}

double PairTimes::ns_per_pair(std::span<const BodyPair> pairs) const {
  QueryView query;
  query.all_pairs = false;
  query.pairs = pairs;
  query.fields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;
  std::vector<double> distance(pairs.size()), lower(pairs.size()), upper(pairs.size()), times;
  std::vector<std::uint8_t> status(pairs.size());
  ReplyView reply;
  reply.rows = pairs.size();
  reply.distance = distance.data();
  reply.lower = lower.data();
  reply.upper = upper.data();
  reply.status = status.data();
  for (int round = 0; round < kRounds; ++round) {
    const double begin = thread_ns();
    engine_.start(query, reply).advance();
    times.push_back(thread_ns() - begin);
  }
  std::nth_element(times.begin(), times.begin() + kRounds / 2, times.end());
  return times[kRounds / 2] / static_cast<double>(pairs.size());
}

}  // namespace clearance
