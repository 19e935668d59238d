#include "tests/engine/motion/motion_oracle.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>

#include "engine/motion/motion_step.h"

namespace clearance::test {

namespace {

constexpr double kTolerance = 1e-3;
constexpr double kRough = 1e-7;   // metres: results of rounded arithmetic this far off need no exact check
constexpr double kDeep = 2e-4;    // metres: deeper than any constructed graze
constexpr int kCoversEvery = 16;  // of trajectories: covers take ten times as long as the rest
constexpr std::uint32_t kSteps = 512, kFewerSteps[] = {1, 2, 4, 12, 64};

struct Look {
  double time;
  ExactScene::Moment moment;
  double least;  // rounded, of all pairs
};

class MotionOracle {
 public:
  MotionOracle(const MotionCase& c, Random& random, MotionFindings& findings, const std::string& backend,
               engine::Covers covers = engine::Covers::kOff)
      : case_(c),
        random_(random),
        findings_(findings),
        of_limits_(random),
        engine_(engine::Scene(c.scene), {.backend = backend, .threads = 1, .covers = covers}),
        has_covers_(covers != engine::Covers::kOff && engine_.wait_covers(std::chrono::minutes(10))) {
    const bool all = random.below(8) == 0;
    for (const BodyPair pair : engine_.pairs(c.motions.view(Reduce::kNone)))
      if (c.exact.answers(pair) && (all || !overlaps_by_chance(pair))) pairs_.push_back(pair);
  }

  void check(bool each_pair) {
    Motions all = case_.motions;
    all.pairs = pairs_;
    const Answer min = evaluate(engine_, least_of(all));
    Answer none;
    if (each_pair) none = evaluate(engine_, all.view(Reduce::kNone));
    for (std::uint32_t m = 0; m < all.count(); ++m) {
      ++findings_.motions;
      findings_.least_on_device += min.info.backend == "cuda";
      motion_ = m;
      looks_.clear();
      look_around(min.view.time[m]);
      findings_.overlaps += min.view.status[m] == static_cast<std::uint8_t>(Status::kOverlap);
      check_row(min, m, nullptr);
      check_contact(min.view.first_contact[2 * m], min.view.first_contact[2 * m + 1], 0);
      if (each_pair) check_pairs(none, m);
      check_decision(kSteps, margin_beside_least(random_));
      for (const std::uint32_t steps : kFewerSteps) check_with(steps);
    }
  }

  // Checks the decisions of another implementation.
  void check_decisions(const MakeMotionDecider& make) {
    const MotionDecider decide = make(engine_.scene());
    Motions all = case_.motions;
    all.pairs = pairs_;
    const Answer min = evaluate(engine_, all.view(Reduce::kMin));
    for (std::uint32_t m = 0; m < all.count(); ++m) {
      ++findings_.motions;
      motion_ = m;
      looks_.clear();
      look_around(min.view.time[m]);
      for (const bool when : {false, true}) {
        check_decision_of(decide, when);
        check_least_of(decide, when);
      }
    }
  }
  bool has_pairs() const { return !pairs_.empty(); }

 private:
  // Without the column that only the CPU supports.
  static QueryView least_of(const Motions& motions, std::uint32_t steps = 256) {
    QueryView query = motions.view(Reduce::kMin, steps);
    query.fields &= ~kFieldPairLower;
    return query;
  }

  // Leaves out pairs that overlap by chance, which would hide findings about the others.
  bool overlaps_by_chance(BodyPair pair) {
    if (chance_.empty())
      for (std::uint32_t m = 0; m < case_.motions.count(); ++m)
        for (const double t : {0.0, 0.25, 0.5, 0.75, 1.0}) chance_.push_back(case_.exact.at(case_.motions, m, t));
    return std::any_of(chance_.begin(), chance_.end(), [&](const ExactScene::Moment& moment) {
      return case_.exact.rough_distance(moment, pair) < -kDeep;
    });
  }

  const Look& look(double time) {
    looks_.push_back({time, case_.exact.at(case_.motions, motion_, time), kInf});
    Look& look = looks_.back();
    for (const BodyPair pair : pairs_) look.least = std::min(look.least, case_.exact.rough_distance(look.moment, pair));
    return look;
  }
  const Look& look_once(double time) {
    const auto known = std::find_if(looks_.begin(), looks_.end(), [&](const Look& l) { return l.time == time; });
    return known == looks_.end() ? look(time) : *known;
  }

  // Samples evenly and where the case should be near, then descends from the nearest sample.
  void look_around(double told) {
    const double named = case_.named[motion_];
    for (const double t : {0.0, 0.3, 0.7, 1.0}) look(t);
    for (const double by : {-1e-4, 0.0, 1e-4}) look_once(std::clamp(named + by, 0.0, 1.0));
    if (!std::isnan(told)) look_once(told);
    best_ = std::min_element(looks_.begin(), looks_.end(), is_nearer)->time;
    double least = look_once(best_).least;
    for (const double step : {2e-2, 5e-3, 1.2e-3, 3e-4, 7e-5, 2e-5})
      for (const double to : {best_ - step, best_ + step}) {
        if (to < 0 || to > 1) continue;
        const double there = look(to).least;
        if (there < least) {
          best_ = to, least = there;
          break;
        }
      }
  }
  // Samples before the time at which the free part ends.
  void look_before(double time) {
    if (time > 0 && time <= 1) look_once(std::max(time - 1e-9, 0.0));
  }
  static bool is_nearer(const Look& a, const Look& b) { return a.least < b.least; }

  // Returns whether a pair, or any, is exactly nearer than a bound, or equally near if `at`.
  bool is_within(const Look& look, double bound, const BodyPair* one, bool at) const {
    const auto is = [&](BodyPair pair) {
      const double rough = case_.exact.rough_distance(look.moment, pair);
      if (std::abs(rough - bound) > kRough) return rough < bound;
      const Real d = case_.exact.distance(look.moment, pair);
      return at ? d <= bound : d < bound;
    };
    return one ? is(*one) : std::any_of(pairs_.begin(), pairs_.end(), is);
  }

  // Checks a row of the least distance, of one pair or of all.
  void check_row(const Answer& answer, std::size_t row, const BodyPair* pair) {
    const ReplyView& view = answer.view;
    const double lower = view.lower[row], upper = view.upper[row], time = view.time[row];
    for (const Look& look : looks_) findings_.nearer += lower > 0 && is_within(look, lower, pair, false);
    const bool overlaps = view.status[row] == static_cast<std::uint8_t>(Status::kOverlap);
    if (!std::isnan(time) && (!pair || overlaps || random_.below(16) == 0)) {
      const Look& there = look_once(time);
      findings_.farther += !is_within(there, upper, pair, true);
      findings_.untrue += overlaps && !is_within(there, 0, pair, true);
    }
    if (view.status[row] == static_cast<std::uint8_t>(Status::kOk) && !(view.flags[row] & kFlagUncertaintyLimited))
      findings_.wide += upper - lower > kTolerance * 1.0001;
  }

  void check_pairs(const Answer& none, std::uint32_t m) {
    for (std::size_t p = 0; p < pairs_.size(); ++p) check_row(none, m * pairs_.size() + p, &pairs_[p]);
  }

  // A margin that is 1e-6 to 1e-4 m less or more than the least sampled distance.
  double margin_beside_least(Random& random) {
    const double graze = std::pow(10.0, random.uniform(-6, -4)) * (random.below(2) ? 1 : -1);
    return std::max(look_once(best_).least + graze, 0.0);
  }

  // Checks first contact for a margin.
  void check_contact(double free_until, double contact, double margin) {
    findings_.untrue += !(free_until <= contact);
    if (contact < kInf) findings_.untrue += !is_within(look_once(contact), margin, nullptr, true);
    look_before(free_until);
    for (const Look& look : looks_)
      findings_.untrue += look.time < free_until && is_within(look, margin, nullptr, true);
  }

  // \param when requests first contact
  void check_least_of(const MotionDecider& decide, bool when) {
    Motions one = case_.one(motion_);
    one.pairs = pairs_;
    QueryView query = least_of(one);
    query.max_evaluations = 512;
    query.margin = random_.below(2) ? margin_beside_least(random_) : 0;
    if (!when) query.fields &= ~kFieldFirstContact;
    const MotionDecision found = decide(query);
    findings_.undecided += found.kind == MotionDecision::kOpen;
    if (found.kind == MotionDecision::kOpen) return;
    ++findings_.least_on_device;
    findings_.farther += !is_within(look_once(found.time), found.upper, &found.pair, true);
    for (const Look& look : looks_) findings_.nearer += found.lower > 0 && is_within(look, found.lower, nullptr, false);
    findings_.wide += !found.by_slack && found.upper - found.lower > kTolerance * 1.0001;
    if (!when) return;
    findings_.wide += found.contact < kInf && !(found.contact - found.free_until <= kContactTime);
    findings_.untrue += (found.contact < kInf) != (found.free_until < kInf);
    check_contact(found.free_until, found.contact, query.margin);
  }

  // \param when requests first contact
  void check_decision_of(const MotionDecider& decide, bool when) {
    Motions one = case_.one(motion_);
    one.pairs = pairs_;
    QueryView query = one.view(Reduce::kAny, 512);
    query.margin = margin_beside_least(random_);
    if (!when) query.fields &= ~kFieldFirstContact;
    const MotionDecision found = decide(query);
    findings_.free += found.kind == MotionDecision::kFree;
    findings_.undecided += found.kind == MotionDecision::kOpen;
    if (found.kind == MotionDecision::kHit) {
      ++findings_.hits;
      const Look& there = look_once(found.time);
      findings_.untrue += !(found.upper <= query.margin);
      findings_.farther += !is_within(there, found.upper, &found.pair, true);
      findings_.nearer += found.lower > 0 && is_within(there, found.lower, &found.pair, false);
    }
    if (found.kind == MotionDecision::kHit && when) {
      findings_.wide += !(found.time - found.free_until <= kContactTime);
      findings_.untrue += !(found.free_until <= found.time);
      look_before(found.free_until);
      for (const Look& look : looks_)
        findings_.untrue += look.time < found.free_until && is_within(look, query.margin, nullptr, true);
    }
    if (found.kind == MotionDecision::kFree)
      for (const Look& look : looks_) findings_.untrue += is_within(look, query.margin, nullptr, true);
  }

  // Checks searches that end after so many configurations.
  void check_with(std::uint32_t steps) {
    Motions one = case_.one(motion_);
    one.pairs = pairs_;
    const Answer min = evaluate(engine_, least_of(one, steps));
    findings_.untrue += min.view.steps[0] > steps;
    check_row(min, 0, nullptr);
    check_contact(min.view.first_contact[0], min.view.first_contact[1], 0);
    check_decision(steps, margin_beside_least(of_limits_));
  }

  // Checks the verdict alone, which covers decide, against a decision without them.
  void check_verdict(QueryView query, bool is_free, bool is_hit) {
    query.fields = kFieldVerdict;
    const auto verdict = static_cast<Status>(evaluate(engine_, query).view.verdict[0]);
    ++findings_.by_covers;
    const bool free = verdict == Status::kBeyond, open = verdict == Status::kUnconverged;
    findings_.untrue += (free && is_hit) || (!free && !open && is_free);
    for (const Look& look : looks_) findings_.untrue += free && is_within(look, query.margin, nullptr, true);
  }

  void check_decision(std::uint32_t steps, double margin) {
    Motions one = case_.one(motion_);
    one.pairs = pairs_;
    QueryView query = one.view(Reduce::kAny, steps);
    query.margin = margin;
    const Answer any = evaluate(engine_, query);
    const auto status = static_cast<Status>(any.view.status[0]);
    const double unproved = any.view.first_contact[0], hit = any.view.first_contact[1], time = any.view.time[0];
    const bool is_free = status == Status::kBeyond, is_open = status == Status::kUnconverged;
    if (has_covers_) check_verdict(query, is_free, !is_free && !is_open);
    findings_.on_device += any.info.backend == "cuda";
    (steps < kSteps ? findings_.stopped : findings_.undecided) += is_open;
    findings_.decided += steps < kSteps && !is_open;
    findings_.free += steps == kSteps && is_free;
    findings_.untrue += any.view.steps[0] > steps;
    findings_.untrue += is_free != (unproved == kInf) || (!is_free && !is_open) != (hit < kInf) || unproved > hit;
    if (!is_free && !is_open) {
      findings_.hits += steps == kSteps;
      findings_.untrue += !is_within(look_once(time), query.margin, &any.view.pair[0], true);
      findings_.untrue += !is_within(look_once(hit), query.margin, nullptr, true);
    }
    look_before(unproved);
    for (const Look& look : looks_) {
      findings_.untrue += look.time < unproved && is_within(look, query.margin, nullptr, true);
      findings_.nearer += any.view.lower[0] > 0 && is_within(look, any.view.lower[0], nullptr, false);
    }
  }

  const MotionCase& case_;
  Random& random_;
  MotionFindings& findings_;
  Random of_limits_;  // of its own, so that limits do not change the cases
  engine::Engine engine_;
  bool has_covers_;
  std::vector<BodyPair> pairs_;
  std::vector<ExactScene::Moment> chance_;
  std::uint32_t motion_ = 0;
  std::vector<Look> looks_;
  double best_ = 0;  // the time of the nearest sample
};

// A folder of this process for the robots' files, removed at the end.
struct Folder {
  std::string path;
  Folder() {
    static std::atomic<int> count{0};
    path = (std::filesystem::temp_directory_path() /
            ("clearance_motions_" + std::to_string(getpid()) + "_" + std::to_string(count++)))
               .string();
    std::filesystem::create_directories(path);
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};

}  // namespace

void MotionFindings::add(const MotionFindings& o) {
  motions += o.motions, free += o.free, hits += o.hits, undecided += o.undecided, overlaps += o.overlaps;
  on_device += o.on_device, least_on_device += o.least_on_device, stopped += o.stopped, decided += o.decided,
      turned += o.turned, by_covers += o.by_covers;
  nearer += o.nearer, farther += o.farther, untrue += o.untrue, wide += o.wide;
}

std::string MotionFindings::text() const {
  const auto n = [](int count) { return std::to_string(count); };
  return n(motions) + " motions, " + n(overlaps) + " with an overlap; by margins beside the truth " + n(free) +
         " free, " + n(hits) + " hits, " + n(undecided) + " undecided, " + n(decided) + " decided and " + n(stopped) +
         " stopped with fewer steps, " + n(by_covers) + " verdicts by covers, " + n(on_device) + " on a device, " +
         n(least_on_device) + " least distances; wrong: " + n(nearer) + " nearer than lower, " + n(farther) +
         " farther than upper, " + n(untrue) + " untrue, " + n(wide) + " too wide";
}

void check_motions(const MotionCase& c, Random& random, bool each_pair, MotionFindings& findings) {
  MotionOracle(c, random, findings, "cpu").check(each_pair);
}

namespace {

// Runs cases of every kind in turn, or of one kind.
// \param check returns whether to continue
template <class CheckCase>
void for_cases(std::uint64_t seed, int only, const CheckCase& check) {
  const Folder folder;
  for (std::uint64_t i = 0;; ++i) {
    const int kind = only < 0 ? static_cast<int>(i % kStraightKinds) : only;
    Random random(seed * 1'000'003 + i * static_cast<std::uint64_t>(kStraightKinds) + static_cast<std::uint64_t>(kind));
    const MotionCase c(random, static_cast<MotionKind>(kind), 4, folder.path);
    if (!check(c, random, i)) return;
  }
}

}  // namespace

MotionFindings check_decisions(std::uint64_t seed, int motions, int only, const MakeMotionDecider& make) {
  MotionFindings findings;
  for_cases(seed, only, [&](const MotionCase& c, Random& random, std::uint64_t) {
    if (c.motions.bodies.empty() || only >= kStraightKinds)
      if (MotionOracle oracle(c, random, findings, "cpu"); oracle.has_pairs()) oracle.check_decisions(make);
    return findings.motions < motions;
  });
  return findings;
}

MotionFindings check_many(std::uint64_t seed, int motions, int only, bool until_wrong, const std::string& backend) {
  MotionFindings findings;
  for_cases(seed, only, [&](const MotionCase& c, Random& random, std::uint64_t i) {
    MotionOracle(c, random, findings, backend).check(i % 4 == 0 || until_wrong);
    return findings.motions < motions && !(until_wrong && findings.wrong() > 0);
  });
  return findings;
}

MotionFindings check_trajectories(std::uint64_t seed, int trajectories) {
  const Folder folder;
  MotionFindings findings;
  for (int i = 0; i < trajectories; ++i) {
    Random random(seed * 1'000'003 + static_cast<std::uint64_t>(i));
    const int segments = 2 + static_cast<int>(random.below(3));
    const MotionCase c(random, MotionKind::kTrajectory, segments, folder.path);
    const bool has_covers = i % kCoversEvery == 0;
    const engine::Covers covers = has_covers ? engine::Covers::kBackground : engine::Covers::kOff;
    MotionOracle(c, random, findings, "cpu", covers).check(i % 4 == 0);
    findings.turned += c.beyond_turns;
  }
  return findings;
}

}  // namespace clearance::test
