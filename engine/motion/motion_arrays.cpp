#include "engine/motion/motion_arrays.h"

#include "engine/motion/motion_bounds.h"

namespace clearance {

bool MotionBounds::flatten(MotionArrays& arrays) const {
  arrays = {};
  const auto place_of = [&](const Link& link, std::uint32_t column) {
    for (const LinkMotion::Moving& m : plan_.motions[link.robot].moving())
      if (m.column == column) return m.at;
    return kNone;
  };
  for (const Chain& chain : chains_) {
    if (chain.size() != 1 || chain[0].robot == kNone) return false;
    const Link& link = chain[0];
    MotionChain flat;
    flat.first = static_cast<std::uint32_t>(arrays.movers.size());
    flat.robot = link.robot;
    flat.error_fixed = link.error.fixed;
    flat.error_per_travel = link.error.per_travel;
    for (Mover mover : link.path.movers()) {
      mover.column = place_of(link, mover.column);
      if (mover.column != kNone) arrays.movers.push_back(mover);  // others do not move
    }
    flat.count = static_cast<std::uint32_t>(arrays.movers.size()) - flat.first;
    arrays.chains.push_back(flat);
  }
  const auto flat_chain = [](std::uint32_t chain) { return chain == kStill ? kNone : chain; };
  for (const std::uint32_t body : plan_.moved) arrays.chain_of_slot.push_back(flat_chain(chain_of_body_[body]));
  arrays.views_of_pair.assign(plan_.pairs.size(), kNone);
  for (const auto& [position, views] : views_) {
    MotionViews flat{{}, views.count};
    for (std::uint32_t v = 0; v < views.count; ++v) {
      const View& view = views.view[v];
      flat.view[v] = {flat_chain(view.a), flat_chain(view.b), view.seer == kNone ? kNone : slot_[view.seer]};
    }
    arrays.views_of_pair[position] = static_cast<std::uint32_t>(arrays.views.size());
    arrays.views.push_back(flat);
  }
  for (const Body& body : scene_.bodies()) arrays.reach.push_back(body.reach);
  return true;
}

}  // namespace clearance
