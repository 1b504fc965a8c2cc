#pragma once

#include <string>
#include <vector>

#include "dynamic_slam/report/table.h"

namespace dynamic_slam {

// Figures of a sequence as they were published, each for one of the columns. "x": tracking failed; "-": not
// given.
struct PublishedRow {
  std::string sequence;
  std::vector<std::string> figures;
};

// A table of the paper (Xiao et al. 2019), or of what others report.
struct PublishedTable {
  std::vector<Table::Column> columns;
  std::vector<PublishedRow> rows;
};

const PublishedTable& PublishedTumApe();               // Table 1, cm
const PublishedTable& PublishedTumRpeTranslation();    // Table 2, cm per frame
const PublishedTable& PublishedTumRpeRotation();       // Table 3, deg per frame
const PublishedTable& PublishedTimes();                // Table 4, s
const PublishedTable& PublishedKittiApe();             // Table 5, m
const PublishedTable& PublishedKittiRpeTranslation();  // Table 6, m per frame
const PublishedTable& PublishedKittiRpeRotation();     // Table 7, deg per m
const PublishedTable& PublishedProfiles();             // Table 8

// What others reach on TUM's dynamic sequences: rmse in cm, and the share of the frames that are tracked.
const PublishedTable& PublishedTumOthers();

}  // namespace dynamic_slam
