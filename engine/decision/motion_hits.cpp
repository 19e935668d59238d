// The middles of a motion's first spans as states: links, and hits of earlier motions.
#include <algorithm>

#include "engine/decision/motion_decider.h"

namespace clearance {

namespace {

// Puts a hit before the others.
template <class Hit>
void put_first(Hit hit, std::vector<Hit>& hits) {
  constexpr std::size_t kMostHits = 8;
  const auto known = std::find(hits.begin(), hits.end(), hit);
  if (known != hits.end())
    std::rotate(hits.begin(), known, known + 1);
  else
    hits.insert(hits.begin(), hit);
  if (hits.size() > kMostHits) hits.pop_back();
}

}  // namespace

// Places the links in all middles. Separate, since tables need no links.
void MotionDecider::place_links() {
  for (std::size_t m = 0; m < plan_.motions.size() && !are_links_placed_; ++m) lanes_[m].place(positions_[m]);
  are_links_placed_ = true;
}

// Takes the links' poses in middle k.
void MotionDecider::take_poses(std::size_t k) {
  place_links();
  given_.place(middles_[k], curves_, poses_.data());
  std::size_t at = plan_.given_bodies;
  for (std::size_t m = 0; m < plan_.motions.size(); ++m) {
    Pose* const links = links_.data() + links_begin_[m];
    for (std::uint32_t i = 0; i < lanes_[m].frames().size(); ++i) links[i] = lanes_[m].pose(i, k);
    for (const std::uint32_t i : plan_.motions[m].links()) poses_[at++] = links[i];
  }
}

// Whether a table or ball that hit in an earlier motion hits in the middle of one of the first spans.
bool MotionDecider::hits_again() {
  const std::size_t count = first_.size();
  for (const std::uint32_t table : tables_)
    for (std::size_t k = 0; k < count; ++k)
      if (is_in_table(table, k)) {
        put_first(table, tables_);
        ++guessed_;
        return true;
      }
  if (hits_.empty()) return false;
  place_links();
  const GuessedHit found = kernel_.guess_hit({&covers_.view(), body_frames_.data(), count, hits_});
  if (!found.hit) return false;
  put_first(*found.hit, hits_);
  ++guessed_;
  return true;
}

// Whether covers find a hit in the middle of one of the first spans, whatever its movement. hits_again() rarely finds
// others: the order of motions changes no verdict, unless the exact search then ends at max_evaluations.
bool MotionDecider::is_hit_at_first() {
  begin_spans();
  state_open_.resize(open_.size());
  for (std::size_t k = 0; k < first_.size(); ++k) {
    take_poses(k);
    const std::uint8_t usable = 1;
    Decision decision;
    kernel_.run({&covers_.view(), poses_.data(), poses_.size(), 1, &usable, true,
                 rows_.data() + k * plan_.joints.size(), plan_.joints.size()},
                {&decision, state_open_.data(), static_cast<std::uint32_t>(state_open_.size())});
    if (decision.verdict == Verdict::kHit) return true;
  }
  return false;
}

// Whether the pair of a joint table is within its margin in middle k.
bool MotionDecider::is_in_table(std::uint32_t table, std::size_t k) const {
  const TabledPair& pair = covers_.view().tabled[table];
  const TableCell* const cell = pair.find(rows_.data() + k * plan_.joints.size());
  return cell && cell->high < pair.hit_below;
}

// Remembers the ball that hit in middle k, or the table if it is none.
void MotionDecider::remember(const BallHit& hit, std::size_t k) {
  if (hit.obstacle == kNone) {
    for (std::uint32_t t = 0; t < covers_.view().tabled_count; ++t)
      if (is_in_table(t, k)) return put_first(t, tables_);
  } else if (covers_.view().bodies[hit.body].is_direct && body_frames_[hit.body]) {
    put_first(hit, hits_);
  }
}

}  // namespace clearance
