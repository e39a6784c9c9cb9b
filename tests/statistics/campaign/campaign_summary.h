// What a campaign comes to, from the lines that its cases left.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

namespace beltgrip::test {

using CampaignResults = std::map<std::uint64_t, nlohmann::json>;  // by seed

// Prints the figures; returns the number of cases that broke a promise, one more
// where too few peaks in reach came to a value.
int summarise(const CampaignResults& results);
// The seeds of the largest slips that a request had a part in, worst first.
std::vector<std::uint64_t> worst_seeds(const CampaignResults& results, std::size_t count);

}  // namespace beltgrip::test
