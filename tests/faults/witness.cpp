#include "tests/faults/witness.h"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "engine/engine.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;

void add_bytes(std::vector<std::byte>& all, const void* from, std::size_t bytes) {
  if (bytes == 0) return;
  all.resize(all.size() + bytes);
  std::memcpy(all.data() + all.size() - bytes, from, bytes);
}

/// The same bytes for the engine's columns and a client's: counts, then the existing columns.
template <class... Columns>
std::vector<std::byte> bytes_of(std::uint64_t rows, std::uint64_t total, std::uint64_t pairs,
                                std::uint64_t configurations, const Columns&... columns) {
  std::vector<std::byte> all;
  for (const std::uint64_t count : {rows, total, pairs, configurations}) add_bytes(all, &count, sizeof count);
  (add_bytes(all, columns.first, columns.first ? columns.second * rows : 0), ...);
  return all;
}

template <class T>
std::pair<const void*, std::size_t> own(const T* column, int field_position) {
  return {column, kFieldBytes[field_position]};
}
template <class T>
std::pair<const void*, std::size_t> got(std::span<const T> column, int field_position) {
  return {column.empty() ? nullptr : column.data(), kFieldBytes[field_position]};
}

std::vector<std::byte> bytes_of(const Result& r) {
  return bytes_of(r.rows(), r.total(), r.pairs(), r.configurations(), got(r.distance(), 0), got(r.lower(), 1),
                  got(r.upper(), 2), got(r.status(), 3), got(r.flags(), 4), got(r.point_a(), 5), got(r.point_b(), 6),
                  got(r.normal(), 7), got(r.pieces(), 8), got(r.gradient(), 9), got(r.pair(), 10),
                  got(r.configuration(), 11), got(r.points32(), 12));
}

std::vector<std::byte> answer_of(const engine::Engine& engine, const KnownQuery& known) {
  const Query& q = known.query;
  QueryView view;
  view.pairs = {reinterpret_cast<const BodyPair*>(known.pairs.data()), known.pairs.size()};
  view.all_pairs = known.pairs.empty();
  view.bodies = known.bodies;
  view.configurations = {reinterpret_cast<const Pose*>(known.configurations.data()), known.configurations.size()};
  view.configuration_count = static_cast<std::uint32_t>(known.configurations.size() / known.bodies.size());
  view.max_distance = q.max_distance;
  view.precision = q.precision;
  view.signed_distance = q.signed_distance;
  view.reduce = q.reduce;
  view.fields = q.fields;
  const test::Answer mine = test::evaluate(engine, view);
  const ReplyView& v = mine.view;
  return bytes_of(mine.info.rows, mine.info.total, mine.size.pairs, mine.size.configurations, own(v.distance, 0),
                  own(v.lower, 1), own(v.upper, 2), own(v.status, 3), own(v.flags, 4), own(v.point_a, 5),
                  own(v.point_b, 6), own(v.normal, 7), own(v.parts, 8), own(v.gradient, 9), own(v.pair, 10),
                  own(v.configuration, 11), own(v.points32, 12));
}

}  // namespace

Exam::Exam(const std::string& scene_file, std::uint64_t seed) {
  const engine::Engine engine(engine::Scene::load(scene_file), {.backend = "cpu", .threads = 1});
  std::vector<std::uint32_t> movable;
  const auto& bodies = engine.scene().bodies();
  for (std::uint32_t b = 0; b < bodies.size(); ++b)
    if (!bodies[b].is_static) movable.push_back(b);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-14, 14);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 48; ++i) {
    auto known = std::make_unique<KnownQuery>();
    Query& q = known->query;
    known->bodies = movable;
    const std::size_t configurations = i % 8 == 0 ? 6 : 1 + i % 3;
    for (std::size_t k = 0; k < configurations * movable.size(); ++k)
      known->configurations.push_back({place(random), place(random), place(random), normal(random), normal(random),
                                       normal(random), normal(random)});
    if (i % 4 < 2)  // a control loop's query: few pairs
      for (std::uint64_t n = 1 + random() % 200; n > 0; --n) {
        const auto a = static_cast<std::uint32_t>(random() % bodies.size());
        known->pairs.push_back(
            {a, static_cast<std::uint32_t>((a + 1 + random() % (bodies.size() - 1)) % bodies.size())});
      }
    q.bodies = known->bodies;
    q.configurations = known->configurations;
    q.pairs = known->pairs;
    q.reduce = static_cast<Reduce>(i / 4 % 4);
    if (i % 3) q.max_distance = 4;
    if (i % 5 == 1) q.precision = Precision::kF32;
    if (i % 7 == 1) q.signed_distance = true;
    q.fields = kDefaultFields | kFieldFlags;
    if (i % 2) q.fields |= kFieldPoints | kFieldNormal | kFieldPieces;
    if (i % 11 == 1) q.fields |= kFieldPoints32;
    known->answer = answer_of(engine, *known);
    queries_.push_back(std::move(known));
  }
}

bool is_right(const Result& reply, const KnownQuery& known) {
  return bytes_of(reply) == known.answer;
}

Result request_surely(Client& client, const KnownQuery& known) {
  const std::string url = client.url();
  client.set_timeout(patience(url));
  for (auto spent = patience(url);; spent += patience(url)) try {
      return client.distances(known.query);
    } catch (const TimeoutError&) {
      if (spent >= kPatience) throw;
    }
}

Witness::Witness(const std::string& url, const Exam& exam, std::uint64_t seed, double load,
                 std::chrono::nanoseconds timeout)
    : url_(url), exam_(exam), load_(load), client_(patient(url)) {
  client_.set_timeout(timeout);
  for (const auto& known : exam_.queries()) evaluate(*known);
  thread_ = std::thread([this, seed] { run(seed); });
}

void Witness::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void Witness::run(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  while (!stopping_) {
    const auto begin = std::chrono::steady_clock::now();
    evaluate(exam_.draw(random));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    std::this_thread::sleep_for(
        std::min<std::chrono::duration<double>>(took * (1 / load_ - 1), 100ms));  // bounded, in case a call was late
  }
}

void Witness::evaluate(const KnownQuery& known) {
  const auto count = [this](std::uint64_t Counts::* what) {
    const std::lock_guard lock(mutex_);
    ++(counts_.*what);
  };
  try {
    const Result reply = client_.distances(known.query);
    if (is_right(reply, known)) {
      ++right_;
      count(&Counts::right);
    } else {
      count(&Counts::wrong);
      complain("a wrong answer of " + std::to_string(reply.rows()) + " rows");
    }
  } catch (const TimeoutError& error) {
    count(&Counts::late);
    complain(error.what());
  } catch (const ConnectionError& error) {
    count(&Counts::lost);
    complain(error.what());
    std::this_thread::sleep_for(5ms);  // as a planner would: the daemon needs the core for its restart
  } catch (const NewEpoch&) {
    count(&Counts::renewed);
    acknowledge();
  } catch (const RequestError& error) {
    count(&Counts::busy);
    complain(error.what());
  } catch (const std::exception& error) {
    count(&Counts::others);
    complain(std::string("unexpected: ") + error.what());
  }
}

void Witness::acknowledge() {
  try {
    client_.acknowledge_epoch();
  } catch (const ConnectionError& error) {  // lost again: the next call fails as well
    complain(error.what());
  }
}

void Witness::complain(const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (complaints_.size() < 10) complaints_.push_back(url_ + ": " + text);
}

Witness::Counts Witness::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::vector<std::string> Witness::complaints() const {
  const std::lock_guard lock(mutex_);
  return complaints_;
}

std::string await_answers(const Witnesses& witnesses, std::uint64_t count) {
  for (const auto& witness : witnesses) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    for (const std::uint64_t begin = witness->right(); witness->right() < begin + count;) {
      if (std::chrono::steady_clock::now() > deadline) return witness->url() + " gets no answers";
      std::this_thread::sleep_for(1ms);
    }
  }
  return "";
}

}  // namespace clearance::faults
