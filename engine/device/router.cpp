#include "engine/device/router.h"

#include <cmath>

namespace clearance::cuda {

QueryKind kind_of(const QueryView& q) {
  if (q.reduce != Reduce::kNone) {
    if (q.configuration_count > 0) return QueryKind::kConfigurations;
    return q.reduce == Reduce::kWithin ? QueryKind::kWithin : QueryKind::kTable;
  }
  if (q.signed_distance) return QueryKind::kDepth;
  if (q.max_distance < INFINITY) return QueryKind::kNear;
  return q.warm_slot != 0 ? QueryKind::kWarm : QueryKind::kDense;
}

std::optional<double> Calibration::device_from(QueryKind kind, int hull_size, double open_share) const {
  const auto& all = samples[static_cast<std::size_t>(kind)][static_cast<std::size_t>(hull_size)];
  const auto lost_ns = [&](const CostSample& s) { return s.device_ns + open_share * s.cpu_ns - s.cpu_ns; };
  std::optional<double> from;
  for (std::size_t i = all.size(); i-- > 0 && lost_ns(all[i]) <= 0; from = all[i].pairs) {
    if (i == 0) return 0;
    const CostSample& before = all[i - 1];
    if (const double lost = lost_ns(before); lost > 0)
      return std::ceil(before.pairs + (all[i].pairs - before.pairs) * lost / (lost - lost_ns(all[i])));
  }
  return from;
}

Router::Router(const Scene& scene, const Device& device, const Calibration& calibration) {
  double vertices = 0, pieces = 0, known = 0;
  const auto n = static_cast<std::uint32_t>(scene.bodies().size());
  for (std::uint32_t b = 0; b < n; ++b) {
    if (device.hull_of(b) == kNone) continue;
    ++known;
    for (const PiecePtr& piece : scene.bodies()[b].pieces) {
      ++pieces;
      vertices += static_cast<double>(piece->vertices.size());
    }
  }
  if (known == 0) return;
  const int hull_size = vertices / pieces <= kSmallHull ? 0 : 1;
  const double share = known / n, open_share = 1 - share * share;
  for (int kind = 0; kind < kQueryKinds; ++kind)
    choices_[static_cast<std::size_t>(kind)].device_from =
        calibration.device_from(static_cast<QueryKind>(kind), hull_size, open_share);
}

bool Router::to_device(const Plan& plan) {
  Choice& choice = choices_[static_cast<std::size_t>(kind_of(plan.query))];
  const double pairs = static_cast<double>(plan.size.configurations) * static_cast<double>(plan.size.pairs);
  const bool device = choice.device_from && pairs >= *choice.device_from;
  ++(device ? choice.to_device : choice.to_cpu);
  return device;
}

void Router::append(Counters& counters) const {
  static constexpr const char* kNames[kQueryKinds] = {"dense", "warm",   "near",          "depth",
                                                      "table", "within", "configurations"};
  for (int kind = 0; kind < kQueryKinds; ++kind) {
    const Choice& choice = choices_[static_cast<std::size_t>(kind)];
    const std::string name = std::string("route.") + kNames[kind];
    counters.emplace_back(name + ".to_cuda", choice.to_device);
    counters.emplace_back(name + ".to_cpu", choice.to_cpu);
    const double from = choice.device_from.value_or(INFINITY);
    constexpr std::uint64_t kNever = ~std::uint64_t{0};
    counters.emplace_back(name + ".cuda_from_pairs", from < 1e18 ? static_cast<std::uint64_t>(from) : kNever);
  }
}

}  // namespace clearance::cuda
