// clearance-peers-ours: the engine as a contender. Whole batches through its public interface, one thread, with bounds,
// witness points and normals.
#include "bench/peers/contender.h"
#include "bench/peers/driver.h"

namespace clearance {
namespace {

class Ours {
 public:
  explicit Ours(const peers::Problem& p)
      : p_(p), engine_(scene_of(p, 0), with_threads(1)), pairs_(pairs_of(p)), moved_(moved_bodies(p)) {
    if (is_large(p)) two_threads_ = std::make_unique<engine::Engine>(scene_of(p, 0), with_threads(2));
    for (std::uint64_t k = 0; k < p.configurations; ++k)
      for (const std::uint32_t b : moved_) poses_.push_back(pose_of(p, k, b));
    const bool steps = p.kind == peers::Kind::kMotion;
    // Space for an eighth of all pairs; about a twentieth are near.
    const std::size_t rows = p.kind == peers::Kind::kWithin ? pairs_.size() / 8
                             : steps                        ? pairs_.size()
                                                            : static_cast<std::size_t>(p.answers());
    lower_.resize(rows), upper_.resize(rows), status_.resize(rows);
    points_a_.resize(3 * rows), points_b_.resize(3 * rows), normals_.resize(3 * rows);
    distances_.resize(rows), found_.resize(rows), configurations_.resize(rows);
  }

  static std::vector<std::string> settings(const peers::Problem& p) {
    if (is_large(p)) return {"f64", "f32", "f64 two threads"};
    return {"f64", "f32"};
  }

  void pass(const std::string& setting, double* answers) {
    QueryView query;
    query.all_pairs = p_.kind == peers::Kind::kWithin;  // as for the peers' trees, which take no list of pairs either
    if (!query.all_pairs) query.pairs = pairs_;
    if (p_.kind == peers::Kind::kWithin) query.reduce = Reduce::kWithin, query.max_results = distances_.size();
    if (p_.kind == peers::Kind::kLeast) query.reduce = Reduce::kMin;
    query.max_distance = p_.max_distance;
    query.signed_distance = p_.kind == peers::Kind::kDepth;
    query.precision = setting.starts_with("f32") ? Precision::kF32 : Precision::kF64;
    query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
    if (p_.kind == peers::Kind::kWithin) {
      evaluate(engine_, query, distances_.data());
    } else if (p_.kind == peers::Kind::kMotion) {
      std::vector<BodyPose> poses(moved_.size());
      for (std::uint64_t k = 0; k < p_.configurations; ++k) {
        for (std::size_t i = 0; i < moved_.size(); ++i) poses[i] = {moved_[i], poses_[k * moved_.size() + i]};
        engine_.set_poses(poses);
        evaluate(engine_, query, answers + k * pairs_.size());
      }
    } else {
      if (p_.configurations > 1) {
        query.configuration_count = static_cast<std::uint32_t>(p_.configurations);
        query.bodies = moved_;
        query.configurations = poses_;
      }
      evaluate(setting.ends_with("two threads") ? *two_threads_ : engine_, query, answers);
    }
  }

  /// For Kind::kWithin: sorts its list in the order of the pairs.
  void finish(double* answers) const {
    if (p_.kind != peers::Kind::kWithin) return;
    std::vector<peers::Found> list;
    for (std::size_t i = 0; i < rows_; ++i) list.push_back({found_[i].a, found_[i].b, distances_[i]});
    peers::spread(p_, list, answers);
  }

 private:
  static engine::Engine::Options with_threads(int threads) {
    engine::Engine::Options options;
    options.threads = threads;
    return options;
  }
  /// Returns whether there are enough pairs for a row with a second thread.
  static bool is_large(const peers::Problem& p) {
    return p.kind == peers::Kind::kDistance && p.exact_value.size() >= 100'000;
  }

  void evaluate(const engine::Engine& engine, const QueryView& query, double* distance) {
    ReplyView reply;
    reply.distance = distance;
    reply.lower = lower_.data(), reply.upper = upper_.data(), reply.status = status_.data();
    reply.point_a = points_a_.data(), reply.point_b = points_b_.data(), reply.normal = normals_.data();
    reply.pair = found_.data(), reply.configuration = configurations_.data();
    Job job = engine.start(query, reply);
    while (!job.advance()) {
    }
    rows_ = job.info().rows;
    if (job.info().total > rows_) throw std::runtime_error("more pairs are near than there is room for");
  }

  const peers::Problem& p_;
  engine::Engine engine_;
  std::unique_ptr<engine::Engine> two_threads_;
  std::vector<BodyPair> pairs_;
  std::vector<std::uint32_t> moved_;
  std::vector<Pose> poses_;  // (K, moved)
  std::vector<double> lower_, upper_, points_a_, points_b_, normals_;
  std::vector<std::uint8_t> status_;
  std::vector<BodyPair> found_;  // by reductions
  std::vector<std::uint32_t> configurations_;
  std::vector<double> distances_;
  std::uint64_t rows_ = 0;
};

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  try {
    if (argc != 2) throw std::runtime_error("usage: see driver.h; the first form only");
    const peers::Problem p = peers::read_problem(argv[1]);
    clearance::Ours ours(p);
    return peers::serve(
        p, clearance::Ours::settings(p), [&](const std::string& s, double* out) { ours.pass(s, out); },
        [&](double* out) { ours.finish(out); });
  } catch (const std::exception& e) {
    std::cerr << "clearance-peers-ours: " << e.what() << '\n';
    return 2;
  }
}
