#include "server/core/reloader.h"

#include <cassert>
#include <chrono>

#include "server/base/real_time.h"

namespace clearance {

Reloader::~Reloader() {
  if (thread_.joinable()) thread_.join();
}

std::uint64_t Reloader::push(Edit edit) {
  edits_.push_back(std::move(edit));
  return ++edits_pushed_;
}

std::optional<Reloader::Outcome> Reloader::take() {
  std::optional<Outcome> outcome;
  if (thread_.joinable() && ended_) {
    thread_.join();
    outcome = std::move(outcome_);
    outcome_ = {};
    ended_ = false;
  }
  return outcome;
}

void Reloader::begin(const std::shared_ptr<engine::Engine>& current, const SceneParts& parts) {
  if (thread_.joinable()) return;
  assert(!ended_ && !outcome_.engine);
  if (requested_.exchange(false)) {
    outcome_.load = ++loads_;
    start([this, parts] {
      load(parts);
      outcome_.warnings = mesh_warnings(outcome_.engine->scene());
    });
  } else if (!edits_.empty()) {
    outcome_.edit = ++edits_begun_;
    start([this, current = current, parts = parts, edit = std::move(edits_.front())]() mutable {
      if (!parts.loaded) parts.loaded = std::make_shared<const engine::Scene>(current->scene());
      current.reset();  // its memory may be freed while the new one is made
      const std::size_t before = parts.added.size();
      edit(parts);
      outcome_.engine = build_(parts.whole());
      const engine::Scene& scene = outcome_.engine->scene();
      if (parts.added.size() > before)
        outcome_.warnings = mesh_warnings(scene, static_cast<std::uint32_t>(scene.bodies().size() - 1));
      outcome_.parts = std::move(parts);
    });
    edits_.pop_front();
  }
}

void Reloader::load(SceneParts parts) {
  outcome_.engine = make_();
  if (parts.added.empty() && parts.reshaped.empty()) return;
  parts.loaded = std::make_shared<const engine::Scene>(outcome_.engine->scene());
  outcome_.engine = build_(parts.whole_as_far_as_possible(outcome_.left_out));
  outcome_.parts = std::move(parts);
}

template <class Work>
void Reloader::start(Work work) {
  thread_ = std::thread([this, work = std::move(work)]() mutable {
    const auto begin = std::chrono::steady_clock::now();
    run_behind();
    try {
      work();
    } catch (const std::exception& error) {
      outcome_.engine = nullptr;
      outcome_.error = error.what();
      outcome_.bad_input = dynamic_cast<const engine::SceneError*>(&error) != nullptr;
    }
    outcome_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    ended_ = true;
    done_();
  });
}

}  // namespace clearance
