// Common part of the contenders' programs: they read a problem and answer it repeatedly.
//
//   PROGRAM PROBLEM
//       prints "settings\tNAME\tNAME...", then reads lines from standard input:
//       time SECONDS SETTING    passes over all pairs until the time is used up; prints "time\tWALL\tPROCESSOR", the
//                               wall and processor seconds of one pass
//       write FILE SETTING      makes another pass and writes its float64 answers (as many as Problem::exact_value has)
//                               to a file; prints "written"
//   PROGRAM PROBLEM FILE SETTING FIRST
//       answers the pairs from FIRST on, one by one, and appends each answer to the file before the next begins, so
//       that the file identifies a pair that crashes. A rejected pair is a NaN.
#pragma once

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "bench/peers/problem.h"

namespace peers {

/// A distance that was not requested or not found.
constexpr double kBeyond = std::numeric_limits<double>::infinity();

/// A pair found for Kind::kWithin.
struct Found {
  std::uint32_t a, b;
  double distance;
};

/// Converts a list of pairs to answers in the order of a problem's pairs: kBeyond for pairs not in the list.
inline void spread(const Problem& p, const std::vector<Found>& list, double* answers) {
  std::unordered_map<std::uint64_t, std::size_t> index;
  for (std::size_t i = 0; i < p.pairs.size(); ++i) index[std::uint64_t{p.pairs[i][0]} << 32 | p.pairs[i][1]] = i;
  std::fill_n(answers, p.pairs.size(), kBeyond);
  for (const Found& f : list)
    answers[index.at(std::uint64_t{std::min(f.a, f.b)} << 32 | std::max(f.a, f.b))] = f.distance;
}

inline double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Runs the first form.
/// \param pass answers all pairs under a setting, in (K, P) order
/// \param finish puts the answers of the last pass in order, outside the timed work
inline int serve(const Problem& p, const std::vector<std::string>& settings,
                 const std::function<void(const std::string& setting, double* answers)>& pass,
                 const std::function<void(double* answers)>& finish) {
  std::vector<double> answers(p.exact_value.size());
  std::cout << "settings";
  for (const std::string& s : settings) std::cout << '\t' << s;
  std::cout << std::endl;
  std::string word, setting;
  while (std::cin >> word) {
    std::string argument;
    std::cin >> argument;
    std::getline(std::cin >> std::ws, setting);
    if (word == "time") {
      const double wall = seconds(CLOCK_MONOTONIC), processor = seconds(CLOCK_PROCESS_CPUTIME_ID);
      int passes = 0;
      do {
        pass(setting, answers.data());
        ++passes;
      } while (seconds(CLOCK_PROCESS_CPUTIME_ID) < processor + std::stod(argument));
      std::printf("time\t%.9g\t%.9g\n", (seconds(CLOCK_MONOTONIC) - wall) / passes,
                  (seconds(CLOCK_PROCESS_CPUTIME_ID) - processor) / passes);
    } else {
      pass(setting, answers.data());
      finish(answers.data());
      std::ofstream out(argument, std::ios::binary);
      detail::put(out, answers.data(), answers.size());
      std::printf("written\n");
    }
    std::fflush(stdout);
  }
  return 0;
}

/// A box with edges along the world axes, in metres.
struct Box {
  Point low{kBeyond, kBeyond, kBeyond}, high{-kBeyond, -kBeyond, -kBeyond};

  void add(const Box& other) {
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], other.low[k]), high[k] = std::max(high[k], other.high[k]);
  }
  /// Squared distance between two boxes.
  static double gap2(const Box& a, const Box& b) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = std::max({0.0, b.low[k] - a.high[k], a.low[k] - b.high[k]});
      sum += d * d;
    }
    return sum;
  }
};

/// Runs a peer's library on a problem. Peer has these members:
///   using Geometry, Transform;                           a Transform is default-constructible
///   static std::vector<std::string> settings(const Problem&);   names of ways to use it, the most usual first
///   Peer(const std::string& setting, const Problem&);    the problem's kind determines whether depths are computed
///   static std::unique_ptr<Geometry> load(const Shape&); throws if the library rejects it
///   static Transform transform(const double R[9], const double t[3], const Geometry&);
///   double distance(const Geometry&, const Transform&, const Geometry&, const Transform&, Cache&);
///                                                        signed if the problem needs depths; may throw
///   using Cache;                                         state of a pair that is kept between steps
///   class Tree;                                          its tree of boxes:
///       explicit Tree(const std::vector<Box>&);
///       template <class F> void each_pair(F f);          f(i, j) once for each two boxes that overlap, in any order
template <class Peer>
class Runner {
 public:
  explicit Runner(const Problem& p) : p_(p), geometry_(p.shapes.size()), shape_boxes_(p.shapes.size()) {
    first_.push_back(0);
    for (const auto& body : p.bodies) first_.push_back(first_.back() + body.size());
    at_.resize(p.configurations * first_.back());
    part_boxes_.resize(at_.size());
    body_boxes_.resize(p.configurations * p.bodies.size());
    for (std::size_t s = 0; s < p.shapes.size(); ++s)
      for (const Point& v : p.shapes[s].vertices) shape_boxes_[s].add({v, v});
  }

  /// Prepares everything that exists before timing starts: geometry, transforms and boxes of every configuration, and
  /// the tree.
  void prepare() {
    for (std::uint32_t s = 0; s < p_.shapes.size(); ++s) load(s);
    for (std::uint64_t k = 0; k < p_.configurations; ++k)
      for (std::uint32_t b = 0; b < p_.bodies.size(); ++b) place(k, b);
    if (p_.kind != Kind::kWithin) return;
    std::vector<Box> wide = body_boxes_;
    for (Box& box : wide)
      for (std::size_t i = 0; i < 3; ++i) box.low[i] -= p_.max_distance / 2, box.high[i] += p_.max_distance / 2;
    tree_ = std::make_unique<typename Peer::Tree>(wide);
  }

  void pass(const std::string& setting, double* answers) {
    Peer peer(setting, p_);
    if (p_.kind == Kind::kWithin) return find(peer);
    std::vector<typename Peer::Cache> cache(p_.kind == Kind::kMotion ? p_.pairs.size() : 1);
    const double limit2 = p_.max_distance * p_.max_distance;
    for (std::uint64_t k = 0; k < p_.configurations; ++k) {
      if (p_.kind == Kind::kLeast) {
        *answers++ = least(peer, k, cache[0]);
        continue;
      }
      const Box* boxes = &body_boxes_[k * p_.bodies.size()];
      for (std::size_t i = 0; i < p_.pairs.size(); ++i) {
        const auto [a, b] = p_.pairs[i];
        const bool far = limit2 < kBeyond && Box::gap2(boxes[a], boxes[b]) > limit2;
        *answers++ = far ? kBeyond : distance(peer, k, a, b, cache[cache.size() > 1 ? i : 0]);
      }
    }
  }

  /// For Kind::kWithin.
  void finish(double* answers) const {
    if (p_.kind == Kind::kWithin) spread(p_, found_, answers);
  }

  void append(const std::string& setting, std::size_t first, const std::string& path) {
    std::FILE* out = std::fopen(path.c_str(), "ab");
    if (!out) throw std::runtime_error("cannot write " + path);
    std::setvbuf(out, nullptr, _IONBF, 0);
    for (std::size_t i = first; i < p_.pairs.size(); ++i) {
      double answer = std::numeric_limits<double>::quiet_NaN();
      try {
        for (const std::uint32_t body : p_.pairs[i]) {
          for (const std::uint32_t shape : p_.bodies[body]) load(shape);
          place(0, body);
        }
        Peer peer(setting, p_);
        typename Peer::Cache cache;
        answer = distance(peer, 0, p_.pairs[i][0], p_.pairs[i][1], cache);
      } catch (const std::exception&) {
      }
      std::fwrite(&answer, sizeof answer, 1, out);
    }
    std::fclose(out);
  }

 private:
  struct Candidate {
    double gap2;
    std::uint32_t a, b;
    bool operator<(const Candidate& other) const { return gap2 < other.gap2; }
  };

  void load(std::uint32_t shape) {
    if (!geometry_[shape]) geometry_[shape] = Peer::load(p_.shapes[shape]);
  }

  void place(std::uint64_t k, std::uint32_t b) {
    const auto& pose = p_.poses[k * p_.bodies.size() + b];
    double R[9];
    rotation(pose, R);
    Box& whole = body_boxes_[k * p_.bodies.size() + b] = {};
    for (std::size_t i = 0; i < p_.bodies[b].size(); ++i) {
      const std::uint32_t s = p_.bodies[b][i];
      at_[slot(k, b, i)] = Peer::transform(R, pose.data(), *geometry_[s]);
      const Box& own = shape_boxes_[s];
      Box& box = part_boxes_[slot(k, b, i)];
      for (std::size_t r = 0; r < 3; ++r) {
        double centre = pose[r], half = p_.shapes[s].radius;
        for (std::size_t c = 0; c < 3; ++c) {
          centre += R[3 * r + c] * (own.low[c] + own.high[c]) / 2;
          half += std::abs(R[3 * r + c]) * (own.high[c] - own.low[c]) / 2;
        }
        box.low[r] = centre - half, box.high[r] = centre + half;
      }
      whole.add(box);
    }
  }
  std::size_t slot(std::uint64_t k, std::uint32_t body, std::size_t part) const {
    return k * first_.back() + first_[body] + part;
  }

  /// Distance of two bodies, or at least `limit` if it is proved to be no less. Parts with the nearest boxes come
  /// first.
  double distance(Peer& peer, std::uint64_t k, std::uint32_t a, std::uint32_t b, typename Peer::Cache& cache,
                  double limit = kBeyond) {
    const auto &convex_parts_a = p_.bodies[a], &convex_parts_b = p_.bodies[b];
    const std::size_t slot_a = slot(k, a, 0), slot_b = slot(k, b, 0);
    const auto one = [&](std::size_t i, std::size_t j) {
      return peer.distance(*geometry_[convex_parts_a[i]], at_[slot_a + i], *geometry_[convex_parts_b[j]],
                           at_[slot_b + j], cache);
    };
    if (convex_parts_a.size() == 1 && convex_parts_b.size() == 1) return one(0, 0);
    parts_.clear();
    for (std::uint32_t i = 0; i < convex_parts_a.size(); ++i)
      for (std::uint32_t j = 0; j < convex_parts_b.size(); ++j)
        parts_.push_back({Box::gap2(part_boxes_[slot_a + i], part_boxes_[slot_b + j]), i, j});
    std::sort(parts_.begin(), parts_.end());
    double least = limit;
    for (const Candidate& c : parts_) {
      if (least <= 0 || c.gap2 >= least * least) break;
      least = std::min(least, one(c.a, c.b));
    }
    return least;
  }

  /// Least distance of all pairs in a configuration, those with the nearest boxes first.
  double least(Peer& peer, std::uint64_t k, typename Peer::Cache& cache) {
    const Box* boxes = &body_boxes_[k * p_.bodies.size()];
    bodies_.clear();
    for (const auto& [a, b] : p_.pairs) bodies_.push_back({Box::gap2(boxes[a], boxes[b]), a, b});
    std::sort(bodies_.begin(), bodies_.end());
    double least = kBeyond;
    for (const Candidate& c : bodies_) {
      if (least <= 0 || c.gap2 >= least * least) break;
      least = std::min(least, distance(peer, k, c.a, c.b, cache, least));
    }
    return least;
  }

  /// Finds the pairs within max_distance with the peer's tree of boxes.
  void find(Peer& peer) {
    found_.clear();
    typename Peer::Cache cache;
    tree_->each_pair([&](std::uint32_t a, std::uint32_t b) {
      if (Box::gap2(body_boxes_[a], body_boxes_[b]) > p_.max_distance * p_.max_distance) return;
      const double d = distance(peer, 0, a, b, cache);
      if (d <= p_.max_distance) found_.push_back({a, b, d});
    });
  }

  const Problem& p_;
  std::vector<std::unique_ptr<typename Peer::Geometry>> geometry_;
  std::vector<Box> shape_boxes_;              // in their own frames
  std::vector<std::size_t> first_;            // index of each body's first part among those of all bodies
  std::vector<typename Peer::Transform> at_;  // (K, parts of all bodies)
  std::vector<Box> part_boxes_, body_boxes_;  // (K, parts of all bodies), (K, B)
  std::unique_ptr<typename Peer::Tree> tree_;
  std::vector<Candidate> parts_, bodies_;
  std::vector<Found> found_;
};

template <class Peer>
int drive(int argc, char** argv) {
  try {
    if (argc != 2 && argc != 5) throw std::runtime_error("usage: see driver.h");
    const Problem p = read_problem(argv[1]);
    Runner<Peer> runner(p);
    if (argc == 5) {
      runner.append(argv[3], std::stoul(argv[4]), argv[2]);
      return 0;
    }
    runner.prepare();
    return serve(
        p, Peer::settings(p), [&](const std::string& s, double* out) { runner.pass(s, out); },
        [&](double* out) { runner.finish(out); });
  } catch (const std::exception& e) {
    std::cerr << argv[0] << ": " << e.what() << '\n';
    return 2;
  }
}

}  // namespace peers
