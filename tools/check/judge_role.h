// What a role's own frames and values say of its configuration. Tools only.
#pragma once

#include <map>
#include <string>

#include "daemon/core/config/options/config.h"
#include "tools/check/finding.h"
#include "tools/check/role_watch.h"

namespace beltgrip::check {

// The role in its user's unit.
class InUnit {
 public:
  explicit InUnit(const daemon::RoleBinding& binding) : binding_(binding) {}
  double value(double si) const {
    return binding_.scale * ((si - binding_.shift) / binding_.factor) + binding_.offset;
  }
  double difference(double si) const { return std::abs(si * binding_.scale / binding_.factor); }
  std::string text(double si) const;
  const std::string& unit() const { return binding_.unit; }

 private:
  const daemon::RoleBinding& binding_;
};

// "0x120", "0x18FF0102x"
std::string id_text(can::CanId id);

// What the DBC says and the configuration does not keep, by role: the unit there.
using DbcUnits = std::map<Role, std::string>;

bool is_required(Role role, const daemon::Config& config);

Findings judge_role(const RoleCourse& course, const RoleWatch& watch, const daemon::Config& config,
                    const DbcUnits& units);

}  // namespace beltgrip::check
