//! Matches a sketch with a map and prints which object is which: sketch ADDRESS [REQUEST]
//!
//! REQUEST is a file with a MatchRequest in binary, in place of the one below.

use std::{env, error::Error, fs, iter, process::ExitCode, time::Duration};

use prost::Message;
use prost_types::{value::Kind, Struct, Value};
use tonic::{Request, Status};
use tonic_types::StatusExt;

use v1::match_response::Event;
use v1::match_service_client::MatchServiceClient;
use v1::{source, AlgorithmSelection, LabelledPolygon, MatchRequest, Pipeline, Point, PolygonSet};
use v1::{Ring, Source, YAxis};

mod v1 {
    tonic::include_proto!("sketchmatch.v1");
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let given: Vec<String> = env::args().skip(1).collect();
    let Some(address) = given.first() else {
        eprintln!("usage: sketch ADDRESS [REQUEST]");
        return ExitCode::from(2);
    };
    let Err(error) = run(address, given.get(1)).await else {
        return ExitCode::SUCCESS;
    };
    match error.downcast_ref::<Status>() {
        Some(status) => explain(status),
        None => println!("{}", whole(error.as_ref())),
    }
    ExitCode::FAILURE
}

/// An error of the transport says in its sources alone what is wrong.
fn whole(error: &dyn Error) -> String {
    let causes = iter::successors(Some(error), |&error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

async fn run(address: &str, file: Option<&String>) -> Result<(), Box<dyn Error>> {
    let mut client = MatchServiceClient::connect(format!("http://{address}")).await?;
    let mut request = Request::new(match file {
        Some(name) => MatchRequest::decode(&fs::read(name)?[..])?,
        None => example(),
    });
    request.set_timeout(Duration::from_secs(60));
    let mut stream = client.r#match(request).await?.into_inner(); // dropping it stops the search
    while let Some(response) = stream.message().await? {
        // Accepted, scenes, progress …, and at last the result.
        if let Some(Event::Result(result)) = response.event {
            for line in result.object_matches {
                println!(
                    "{} {} is {} {}, confidence {:.3}",
                    line.sketch_object,
                    line.sketch_label,
                    line.map_object,
                    line.map_label,
                    line.confidence
                );
            }
        }
    }
    Ok(())
}

/// What is to be matched: here the map shows the sketch's three objects at twice the size.
fn example() -> MatchRequest {
    let directions = Value { kind: Some(Kind::NumberValue(36.0)) };
    let parameters = Struct { fields: [("directions".into(), directions)].into() };
    let histogram = AlgorithmSelection { name: String::new(), parameters: Some(parameters) };
    let sketch = vec![
        rectangle("bed", 1.0, 1.0, 4.0, 2.0),
        rectangle("desk", 7.0, 2.0, 2.0, 3.0),
        rectangle("shelf", 2.0, 6.0, 1.0, 5.0),
    ];
    let map = vec![
        rectangle("table", 14.0, 12.0, 4.0, 6.0),
        rectangle("bunk", 2.0, 16.0, 8.0, 4.0),
        rectangle("rack", 4.0, 0.0, 2.0, 10.0),
    ];
    MatchRequest {
        sketch: Some(polygons(sketch, YAxis::Down)), // as on a screen: y grows downwards
        map: Some(polygons(map, YAxis::Up)),
        pipeline: Some(Pipeline { histogram: Some(histogram), ..Default::default() }),
        ..Default::default()
    }
}

fn polygons(polygons: Vec<LabelledPolygon>, y_axis: YAxis) -> Source {
    let set = PolygonSet { polygons, y_axis: y_axis.into() };
    Source { kind: Some(source::Kind::PolygonSet(set)) }
}

fn rectangle(label: &str, x: f64, y: f64, width: f64, height: f64) -> LabelledPolygon {
    let corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)];
    let points = corners.into_iter().map(|(x, y)| Point { x, y }).collect();
    LabelledPolygon { label: label.into(), rings: vec![Ring { points }], ..Default::default() }
}

/// Prints what the server says of an error: a sentence for people, details for programs.
fn explain(status: &Status) {
    println!("error {}: {}", status.code() as i32, status.message());
    let details = status.get_error_details();
    if let Some(info) = details.error_info() {
        println!("reason {}", info.reason);
    }
    for violation in details.bad_request().iter().flat_map(|bad| &bad.field_violations) {
        println!("field {}", violation.field);
    }
    if let Some(delay) = details.retry_info().and_then(|retry| retry.retry_delay) {
        println!("retry after {delay:?}");
    }
}
