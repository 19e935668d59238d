// What the contenders' programs have in common: they read a problem, and answer it as often as they are told to.
//
//   PROGRAM PROBLEM                       prints "settings\tNAME\tNAME...", then takes lines from standard input:
//       time SECONDS SETTING              passes over all pairs until so much time is spent; prints
//       "time\tSECONDS_A_PASS" write FILE SETTING                one more pass, its (K, P) float64 answers to a file;
//       prints "written"
//   PROGRAM PROBLEM FILE SETTING FIRST    answers pairs from FIRST on, one by one, each appended to the file before the
//   next
//                                         begins: so that a crash tells which pair it was. A refusal is a NaN.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "problem.h"

namespace peers {

/// The first form. \param pass answers all pairs under a setting, in (K, P) order.
inline int serve(const Problem& p, const std::vector<std::string>& settings,
                 const std::function<void(const std::string& setting, double* answers)>& pass) {
  std::vector<double> answers(p.truth.size());
  std::cout << "settings";
  for (const std::string& s : settings) std::cout << '\t' << s;
  std::cout << std::endl;
  std::string word, setting;
  while (std::cin >> word) {
    std::string argument;
    std::cin >> argument;
    std::getline(std::cin >> std::ws, setting);
    if (word == "time") {
      using Clock = std::chrono::steady_clock;
      const auto start = Clock::now();
      double seconds = 0;
      int passes = 0;
      do {
        pass(setting, answers.data());
        ++passes;
        seconds = std::chrono::duration<double>(Clock::now() - start).count();
      } while (seconds < std::stod(argument));
      std::printf("time\t%.9g\n", seconds / passes);
    } else {
      pass(setting, answers.data());
      std::ofstream out(argument, std::ios::binary);
      detail::put(out, answers.data(), answers.size());
      std::printf("written\n");
    }
    std::fflush(stdout);
  }
  return 0;
}

/// A peer's library behind four functions:
///   using Geometry, Transform;
///   static std::vector<std::string> settings(Kind);      names of ways to use it, the most usual first
///   explicit Peer(const std::string& setting);
///   static std::unique_ptr<Geometry> load(const Shape&); throws if the library refuses it
///   static Transform transform(const double R[9], const double t[3]);
///   double distance(const Geometry&, const Transform&, const Geometry&, const Transform&, Cache&);
///                                                        signed where the setting can; may throw
///   using Cache;                                         whatever it keeps of a pair from step to step
template <class Peer>
class Runner {
 public:
  explicit Runner(const Problem& p) : p_(p), geometry_(p.shapes.size()), low_(p.shapes.size()), high_(p.shapes.size()) {
    for (const auto& body : p.bodies) many_ = many_ || body.size() > 1;
    for (std::size_t s = 0; s < p.shapes.size(); ++s) bound(s);
  }

  void load(std::uint32_t shape) {
    if (!geometry_[shape]) geometry_[shape] = Peer::load(p_.shapes[shape]);
  }
  void load_all() {
    for (std::uint32_t s = 0; s < p_.shapes.size(); ++s) load(s);
  }

  void pass(const std::string& setting, double* answers) {
    Peer peer(setting);
    std::vector<typename Peer::Cache> cache(many_ ? 1 : p_.pairs.size());
    for (std::uint64_t k = 0; k < p_.configurations; ++k) {
      place(k);
      for (std::size_t i = 0; i < p_.pairs.size(); ++i)
        *answers++ = distance(peer, p_.pairs[i][0], p_.pairs[i][1], cache[many_ ? 0 : i]);
    }
  }

  void append(const std::string& setting, std::size_t first, const std::string& path) {
    place(0);
    std::FILE* out = std::fopen(path.c_str(), "ab");
    if (!out) throw std::runtime_error("cannot write " + path);
    std::setvbuf(out, nullptr, _IONBF, 0);
    for (std::size_t i = first; i < p_.pairs.size(); ++i) {
      double answer = std::numeric_limits<double>::quiet_NaN();
      try {
        for (const std::uint32_t body : p_.pairs[i])
          for (const std::uint32_t shape : p_.bodies[body]) load(shape);
        Peer peer(setting);
        typename Peer::Cache cache;
        answer = distance(peer, p_.pairs[i][0], p_.pairs[i][1], cache);
      } catch (const std::exception&) {
      }
      std::fwrite(&answer, sizeof answer, 1, out);
    }
    std::fclose(out);
  }

 private:
  struct Box {
    Point low, high;
  };
  struct Candidate {
    double gap;
    std::size_t a, b;
  };

  void bound(std::size_t s) {
    low_[s] = high_[s] = p_.shapes[s].vertices[0];
    for (const Point& v : p_.shapes[s].vertices)
      for (std::size_t k = 0; k < 3; ++k)
        low_[s][k] = std::min(low_[s][k], v[k]), high_[s][k] = std::max(high_[s][k], v[k]);
  }

  // Where all bodies are; of bodies of several pieces, a box around each piece.
  void place(std::uint64_t k) {
    at_.clear();
    boxes_.resize(many_ ? p_.bodies.size() : 0);
    for (std::size_t b = 0; b < p_.bodies.size(); ++b) {
      const auto& pose = p_.poses[k * p_.bodies.size() + b];
      double R[9];
      rotation(pose, R);
      at_.push_back(Peer::transform(R, pose.data()));
      if (!many_) continue;
      boxes_[b].clear();
      for (const std::uint32_t s : p_.bodies[b]) {
        Box box;
        for (std::size_t r = 0; r < 3; ++r) {
          double centre = pose[r], half = p_.shapes[s].radius;
          for (std::size_t c = 0; c < 3; ++c) {
            centre += R[3 * r + c] * (low_[s][c] + high_[s][c]) / 2;
            half += std::abs(R[3 * r + c]) * (high_[s][c] - low_[s][c]) / 2;
          }
          box.low[r] = centre - half, box.high[r] = centre + half;
        }
        boxes_[b].push_back(box);
      }
    }
  }

  static double gap(const Box& a, const Box& b) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = std::max({0.0, b.low[k] - a.high[k], a.low[k] - b.high[k]});
      sum += d * d;
    }
    return std::sqrt(sum);
  }

  double distance(Peer& peer, std::uint32_t a, std::uint32_t b, typename Peer::Cache& cache) {
    const auto &pieces_a = p_.bodies[a], &pieces_b = p_.bodies[b];
    const auto one = [&](std::size_t i, std::size_t j) {
      return peer.distance(*geometry_[pieces_a[i]], at_[a], *geometry_[pieces_b[j]], at_[b], cache);
    };
    if (pieces_a.size() == 1 && pieces_b.size() == 1) return one(0, 0);
    candidates_.clear();
    for (std::size_t i = 0; i < pieces_a.size(); ++i)
      for (std::size_t j = 0; j < pieces_b.size(); ++j) candidates_.push_back({gap(boxes_[a][i], boxes_[b][j]), i, j});
    std::sort(candidates_.begin(), candidates_.end(),
              [](const Candidate& x, const Candidate& y) { return x.gap < y.gap; });
    double least = std::numeric_limits<double>::infinity();
    for (const Candidate& c : candidates_) {
      if (c.gap >= least) break;
      least = std::min(least, one(c.a, c.b));
    }
    return least;
  }

  const Problem& p_;
  bool many_ = false;  // some body has several pieces
  std::vector<std::unique_ptr<typename Peer::Geometry>> geometry_;
  std::vector<Point> low_, high_;
  std::vector<typename Peer::Transform> at_;
  std::vector<std::vector<Box>> boxes_;
  std::vector<Candidate> candidates_;
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
    runner.load_all();
    return serve(p, Peer::settings(p.kind), [&](const std::string& s, double* out) { runner.pass(s, out); });
  } catch (const std::exception& e) {
    std::cerr << argv[0] << ": " << e.what() << '\n';
    return 2;
  }
}

}  // namespace peers
