use v1::match_response::Event;
use v1::match_service_client::MatchServiceClient;
use v1::source::Kind;
use v1::{EncodedFile, MapServerMap, MatchRequest, Source};

mod v1 {
    tonic::include_proto!("sketchmatch.v1");
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (name, data) = ("sketch.svg".into(), std::fs::read("sketch.svg")?);
    let sketch = Kind::File(EncodedFile { name, data, ..Default::default() });
    let (yaml, image) = (std::fs::read_to_string("room.yaml")?, std::fs::read("room.pgm")?);
    let map = Kind::MapServerMap(MapServerMap { yaml, image, ..Default::default() });
    let request = MatchRequest {
        sketch: Some(Source { kind: Some(sketch) }),
        map: Some(Source { kind: Some(map) }),
        ..Default::default()
    };
    let mut client = MatchServiceClient::connect("http://localhost:50051").await?;
    let mut stream = client.r#match(request).await?.into_inner();
    while let Some(response) = stream.message().await? {
        if let Some(Event::Result(result)) = response.event {
            for line in result.object_matches {
                println!("{} is object {}", line.sketch_label, line.map_object);
            }
        }
    }
    Ok(())
}
